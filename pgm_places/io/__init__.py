"""Files: maps, labels, models, results."""
