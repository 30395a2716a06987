"""Read runs: SQL views and summaries."""
