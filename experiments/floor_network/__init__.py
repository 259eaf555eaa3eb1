"""The floor network: its training floors, the folds of buildings, and its figures."""
