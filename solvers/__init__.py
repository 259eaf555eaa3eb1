"""Solvers: pure functions on arrays."""
