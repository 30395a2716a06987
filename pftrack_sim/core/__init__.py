"""Boxes, records, errors, random streams: what every room uses."""
