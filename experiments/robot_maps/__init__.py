"""Maps that robots made, of buildings that the shipped models never saw, measured by kind."""
