"""Topological maps: regions of labels, their corrections, places and connections."""
