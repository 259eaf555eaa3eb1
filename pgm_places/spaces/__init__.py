"""Free space as segments at several scales, gates between them, and places between gates."""
