"""The columns of the table of beams that a sweep reads, and how its buffers are padded."""

__all__ = [
    "BLOCK",
    "LAST_COLUMN",
    "LIFT",
    "LOG_BINS",
    "METRES_MAJOR",
    "METRES_MINOR",
    "METRES_X",
    "METRES_Y",
    "N_FIELDS",
    "N_PLACES",
    "PER_X",
    "PER_Y",
    "SHIFT",
    "SLOPE",
    "STEP_X",
    "STEP_Y",
]

BLOCK = 32
"""Cells looked up at a time; buffers are padded by as many."""

N_FIELDS = 14
# In the octant's frame:
SLOPE = 0  # rows a column
LOG_BINS = 1  # 2 to this power bins for each cell of u
SHIFT = 2  # whole number that u is counted from, so that it is positive in the whole map
LIFT = 3  # place of u = 0 below the first place of a plane
N_PLACES = 4  # length of a plane
LAST_COLUMN = 5  # furthest column that the beam reaches from the tile
METRES_MAJOR = 6  # length of ray for each column
METRES_MINOR = 7  # length of ray for each row
# In the map's frame, for following single rays:
STEP_X = 8
STEP_Y = 9
PER_X = 10  # length of ray for each column, in cells
PER_Y = 11
METRES_X = 12  # the same in metres
METRES_Y = 13
