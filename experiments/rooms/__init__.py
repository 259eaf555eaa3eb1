"""Bormann et al.'s benchmark of room segmentation: its maps, scores, and the tables of a run."""
