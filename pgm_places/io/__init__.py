"""Files: maps and labels, logs, places, and how they are read and written safely."""
