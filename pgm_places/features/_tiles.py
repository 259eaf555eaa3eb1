"""How sixteen scans, a tile, lie in the planes of the kernels, which know it by ``_tiles.hpp``."""

from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES

N_BEAMS = CANONICAL_BEAMS
N_FEATURES = len(LASER_FEATURES)

LANES = 16

TILE_ROWS = N_BEAMS + 1
"""Row ``TILE_ROWS tile + k`` holds beam ``k`` of a tile's scans, one a lane; beam 360 is beam 0."""

SHAPE_ROWS = 4
"""Rows a tile has in ``shape``: area, perimeter and centroid, which later kernels need."""
