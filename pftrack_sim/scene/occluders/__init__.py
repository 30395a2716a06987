"""Bodies of occluders."""
