"""Simulated laser scans: ray casting in maps, sensor noise, robots, and scan completion."""
