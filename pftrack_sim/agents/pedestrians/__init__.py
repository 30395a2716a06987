"""Motion of pedestrians and carts."""
