"""Laser scans: ray casting in a map, and the noise of a real sensor."""
