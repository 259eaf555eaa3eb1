"""Experiments on real buildings, one configuration each."""
