"""What maps, drives and results draw on matplotlib axes in notebooks."""
