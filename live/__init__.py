"""Live labelling of a growing map and a robot's scans, independent of the middleware."""
