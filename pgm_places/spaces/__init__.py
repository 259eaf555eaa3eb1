"""The shape of free space: segments at several scales, gates between them, places between gates."""
