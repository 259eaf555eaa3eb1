"""Labelers: a unary model and an inference method, learned together."""
