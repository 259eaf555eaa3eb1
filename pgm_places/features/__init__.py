"""Geometric features of laser scans, and custom features."""
