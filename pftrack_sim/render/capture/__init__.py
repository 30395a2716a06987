"""Frames with exposure time, rolling shutter and lens distortion."""
