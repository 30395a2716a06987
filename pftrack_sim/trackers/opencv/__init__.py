"""Trackers of OpenCV."""
