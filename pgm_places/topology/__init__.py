"""From labels to places: regions, their corrections, and the topological map."""
