"""Drives as files: CARMEN logs, CSV files and ROS bags."""
