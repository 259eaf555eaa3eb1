"""Labelled places as files: the topological map and its exports."""
