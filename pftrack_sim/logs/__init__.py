"""Logs of episodes for the viewers of robotics: Rerun recordings, and MCAP files of ROS 2 messages."""

from pftrack_sim.logs.frame import LogFrame, LogInfo
from pftrack_sim.logs.writers import FORMATS, check_formats, log_format, log_writer

__all__ = ["FORMATS", "LogFrame", "LogInfo", "check_formats", "log_format", "log_writer"]
