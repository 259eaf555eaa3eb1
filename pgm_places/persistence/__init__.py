"""Persistence: what is learned as a folder of data, and back."""
