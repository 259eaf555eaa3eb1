"""Labelling problems, potentials and results, and the inference methods by name."""
