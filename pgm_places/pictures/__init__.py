"""Maps, topological maps and routes drawn as small palette images."""
