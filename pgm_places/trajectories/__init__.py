"""Trajectories: a robot's poses and scans over time."""
