"""The foyer of a generated building, labelled, halls apart from corridors."""

import numpy as np

from pgm_places import LabelledMap
from pgm_places.simulation import generate_building


def foyer_map() -> LabelledMap:
    """The hall of a building, and what lies around it; label 3 is ``hall``."""
    made = generate_building(9, style="hall", halls="hall", furniture=False, slam_noise=False)
    part = np.s_[90:680, 460:980]
    return LabelledMap(made.grid.with_cells(made.grid.cells[part]), made.labels[part])
