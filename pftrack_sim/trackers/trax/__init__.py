"""The TraX protocol, in both directions: trackers of other programs here (`client`), ours elsewhere (`server`)."""

PREFIX = "trax:"
"""Begins the name of a tracker that another program runs; its command follows."""
