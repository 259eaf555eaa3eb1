"""Small comparisons to report on."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment.comparison import Comparison, MethodResult, history_of
from pgm_places.experiment.evaluated_items import EvalMap
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import DoorScores

NAMES = ("corridor", "room", "doorway")


def small_map(name: str = "floor", *, n_labels: int = 3) -> EvalMap:
    """A walled map of 6 x 9 cells whose columns belong to the labels in turn."""
    cells = np.full((6, 9), 100)
    cells[1:-1, 1:-1] = 0
    cells[0, 0] = -1
    grid = OccupancyGrid(cells, 0.5)
    truth = np.full(grid.shape, -1, np.int16)
    truth[1:-1, 1:-1] = np.arange(7) % n_labels
    truth[1, 1] = -1
    layout = GridLayout.of_map(grid)
    return EvalMap(name, grid, truth, layout, np.ones(grid.shape, np.bool_))


def labeling_of(
    item: EvalMap, *, beliefs: bool, info: Mapping[str, Any] | None = None, n_labels: int = 3
) -> Labeling:
    """The truth with one wrong cell, and beliefs that are 80 % sure of it."""
    labels = np.maximum(item.layout.from_raster(item.truth), 0).astype(np.int64)
    labels[-1] = (labels[-1] + 1) % n_labels
    soft = np.full((len(labels), n_labels), 0.2 / (n_labels - 1))
    soft[np.arange(len(labels)), labels] = 0.8
    return Labeling(
        labels,
        Status.CONVERGED,
        soft if beliefs else None,
        score=10.0,
        bound=12.5,
        info=info or {},
    )


def small_comparison(
    *,
    title: str = "A comparison",
    label_names: tuple[str, ...] = NAMES,
    map_names: tuple[str, ...] = ("floor",),
    method_id: str = "relaxation",
    beliefs: bool = True,
    info: Mapping[str, Any] | None = None,
    doors: tuple[DoorScores, ...] = (),
    **others: Any,
) -> Comparison:
    """Two methods, ``plain`` without extras and another one, on one or more maps."""
    n_labels = len(label_names)
    maps = tuple(small_map(name, n_labels=n_labels) for name in map_names)
    methods = []
    for key, soft, more in (("plain", False, None), (method_id, beliefs, info)):
        labelings = tuple(
            labeling_of(item, beliefs=soft, info=more, n_labels=n_labels) for item in maps
        )
        evaluations = tuple(
            evaluate(
                item.layout.from_raster(item.truth),
                labeling.labels,
                label_names,
                beliefs=labeling.beliefs,
            )
            for item, labeling in zip(maps, labelings, strict=True)
        )
        seconds = {"learn": 1.5, "infer": 0.25}
        methods.append(
            MethodResult(
                key,
                key.title(),
                {"max_iterations": 50},
                labelings,
                evaluations,
                Evaluation.merged(evaluations),
                seconds,
                histories=tuple(history_of(labeling) for labeling in labelings),
                doors=doors,
            )
        )
    record: dict[str, Any] = {
        "stage_seconds": {"load": 0.5},
        "config": {"labels": {"names": list(label_names)}},
        "versions": {"pgm-places": "1.2.3"},
        "inputs": {"map.yaml": "ab" * 32},
        "warnings": (),
    }
    return Comparison(title, label_names, maps, tuple(methods), **(record | others))
