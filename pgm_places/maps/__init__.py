"""Maps: the occupancy grid, its coarsening, and a grid with labels."""
