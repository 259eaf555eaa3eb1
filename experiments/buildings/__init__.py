"""Accuracy in buildings left out: maps, lists, and the section of docs/results.md."""
