"""Exact ground truth of a frame: boxes, visibility, poses."""
