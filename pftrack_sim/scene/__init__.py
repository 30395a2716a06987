"""Builders of the MuJoCo model: places, people, robot, occluders, lights."""
