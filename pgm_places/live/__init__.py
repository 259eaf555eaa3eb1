"""Labelling while the map grows: a core that knows no middleware."""
