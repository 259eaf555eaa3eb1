"""Plots of maps, drives and results on matplotlib axes, for notebooks."""
