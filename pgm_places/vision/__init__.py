"""Objects seen by a camera, counted: features in addition to the laser's (paper, section 4.1)."""
