"""Labelling a map with a loaded model, finding its places, and writing the results."""
