"""Robots of users: MJCF and URDF files, and what in them carries the camera."""
