"""Off-screen OpenGL."""
