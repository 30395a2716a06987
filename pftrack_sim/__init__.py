"""A Gymnasium environment for tracking people from a moving robot camera, with exact truth."""
