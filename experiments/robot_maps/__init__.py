"""Evaluation on robots' maps of buildings outside the training data, by kind of building."""
