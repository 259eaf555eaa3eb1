"""Geometric features of a laser scan."""
