"""Object counts from camera images, as features beside the laser's (paper, section 4.1)."""
