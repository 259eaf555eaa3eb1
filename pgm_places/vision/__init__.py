"""Objects that a camera sees, counted: features beside the laser's (paper, section 4.1)."""
