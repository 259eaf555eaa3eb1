"""Labelling problems, potentials, results, and the registry of inference methods."""
