"""Semantic place labelling: occupancy grids and trajectories in, labelled places out."""

import logging

from pgm_places._version import __version__
from pgm_places.errors import PgmPlacesError
from pgm_places.graph import EdgeKind, LabelGraph
from pgm_places.grid import OccupancyGrid
from pgm_places.labeling import Labeling, Status
from pgm_places.potentials import Potentials, score
from pgm_places.problem import LabelingProblem

__all__ = [
    "EdgeKind",
    "LabelGraph",
    "Labeling",
    "LabelingProblem",
    "OccupancyGrid",
    "PgmPlacesError",
    "Potentials",
    "Status",
    "__version__",
    "score",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
