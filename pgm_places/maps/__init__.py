"""Occupancy grids, their coarsening, and labelled maps."""
