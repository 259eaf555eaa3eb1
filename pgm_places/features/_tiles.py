"""How sixteen scans, a tile, lie in the planes that the kernels share."""

from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES

N_BEAMS = CANONICAL_BEAMS
N_FEATURES = len(LASER_FEATURES)

TILE_ROWS = N_BEAMS + 1
"""Row ``TILE_ROWS tile + k`` holds beam ``k`` of a tile's scans, one a lane; beam 360 is beam 0."""
