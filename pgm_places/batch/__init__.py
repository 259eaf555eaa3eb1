"""Many maps at once: found, shared out to worker processes, resumed, and listed on one page."""
