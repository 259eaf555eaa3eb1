"""Reading and writing files: maps, labels, logs, places."""
