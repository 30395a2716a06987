"""OpenCV's trackers."""
