"""Motion of the robot: drive, script, odometry, range finder, road."""
