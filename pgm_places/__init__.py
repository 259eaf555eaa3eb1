"""Semantic place labelling: occupancy grids and trajectories in, labelled places out.

Names are imported when they are first used, so that ``import pgm_places`` costs nothing.
"""

import importlib
import logging
from typing import TYPE_CHECKING, Any

from pgm_places._version import __version__

if TYPE_CHECKING:
    from pgm_places.errors import PgmPlacesError
    from pgm_places.evaluation.evaluation import evaluate
    from pgm_places.graph.edge_kind import EdgeKind
    from pgm_places.graph.label_graph import LabelGraph
    from pgm_places.inference.backends import build
    from pgm_places.inference.labeling import Labeling, Status
    from pgm_places.inference.potentials import Potentials, score
    from pgm_places.inference.problem import LabelingProblem
    from pgm_places.labelers.place_labeler import PlaceLabeler
    from pgm_places.labelers.structured_labeler import StructuredLabeler
    from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
    from pgm_places.maps.labelled_map import LabelledMap
    from pgm_places.maps.occupancy_grid import OccupancyGrid
    from pgm_places.persistence.backend import load_backend, save_backend
    from pgm_places.persistence.structured_labeler import (
        load_structured_labeler,
        save_structured_labeler,
    )
    from pgm_places.sensing.sensor import Sensor, SensorNoise
    from pgm_places.trajectories.scan import Scan, ScanGeometry
    from pgm_places.trajectories.similarity import Similarity
    from pgm_places.trajectories.trajectory import Trajectory

_HOMES = {
    "EdgeKind": "graph.edge_kind",
    "LabelGraph": "graph.label_graph",
    "LabelledMap": "maps.labelled_map",
    "Labeling": "inference.labeling",
    "LabelingProblem": "inference.problem",
    "OccupancyGrid": "maps.occupancy_grid",
    "PgmPlacesError": "errors",
    "PlaceLabeler": "labelers.place_labeler",
    "Potentials": "inference.potentials",
    "Scan": "trajectories.scan",
    "ScanGeometry": "trajectories.scan",
    "Sensor": "sensing.sensor",
    "SensorNoise": "sensing.sensor",
    "Similarity": "trajectories.similarity",
    "Status": "inference.labeling",
    "StructuredLabeler": "labelers.structured_labeler",
    "Trajectory": "trajectories.trajectory",
    "TrajectoryLabeler": "labelers.trajectory_labeler",
    "build": "inference.backends",
    "evaluate": "evaluation.evaluation",
    "load_backend": "persistence.backend",
    "load_structured_labeler": "persistence.structured_labeler",
    "save_backend": "persistence.backend",
    "save_structured_labeler": "persistence.structured_labeler",
    "score": "inference.potentials",
}

__all__ = [
    "EdgeKind",
    "LabelGraph",
    "Labeling",
    "LabelingProblem",
    "LabelledMap",
    "OccupancyGrid",
    "PgmPlacesError",
    "PlaceLabeler",
    "Potentials",
    "Scan",
    "ScanGeometry",
    "Sensor",
    "SensorNoise",
    "Similarity",
    "Status",
    "StructuredLabeler",
    "Trajectory",
    "TrajectoryLabeler",
    "__version__",
    "build",
    "evaluate",
    "load_backend",
    "load_structured_labeler",
    "save_backend",
    "save_structured_labeler",
    "score",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'pgm_places' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"pgm_places.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
