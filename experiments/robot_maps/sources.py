"""Sources of labels in the comparison: a model, with or without further evidence."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.doorways import Doorways
from pgm_places.unary.map_model import CellScores

Evidence = Callable[[OccupancyGrid, LabelGraph, CellScores], NDArray[np.float64]]
"""Gives the log-probabilities (N, K) of a map's nodes that the method is to label, instead of those
of the model: a network, or a mixture of both."""


@dataclass(frozen=True, eq=False)
class Found:
    """What a source says of a map.

    Parameters
    ----------
    labels : (H, W) int64
        -1 for cells that are not free.
    labeling : Labeling
    doorways : Doorways or None
    """

    labels: NDArray[np.int64]
    labeling: Labeling
    doorways: Doorways | None


@dataclass(frozen=True, eq=False)
class Source:
    """A fitted labeler and one of its methods, with further evidence or without."""

    labeler: PlaceLabeler
    method: str | None = None
    evidence: Evidence | None = None

    def label(self, grid: OccupancyGrid) -> Found:
        """The labels of a map that has the model's cells, and its doorways."""
        graph, scores = self.labeler.scores(grid, methods=[self._name])
        return self.decoded(grid, graph, scores)

    @property
    def _name(self) -> str:
        return self.method or self.labeler.default_method

    def decoded(self, grid: OccupancyGrid, graph: LabelGraph, scores: CellScores) -> Found:
        """The labels that follow from the scores of a map."""
        name = self._name
        if self.evidence is not None:
            fields: dict[str, Any] = {
                self.labeler.method(name).unary: self.evidence(grid, graph, scores)
            }
            scores = replace(scores, **fields)
        labeling = self.labeler.infer(graph, scores, method=name)
        doorways = None if scores.spaces is None else scores.spaces.doorways
        assert isinstance(graph.layout, GridLayout)  # the graph is that of a map
        return Found(graph.layout.to_raster(labeling.labels, fill=-1), labeling, doorways)


def lists_alone(labeler: PlaceLabeler) -> PlaceLabeler:
    """The labeler without its networks: methods with floor networks use space features instead."""
    methods = {
        name: replace(method, unary="space") if method.unary == "floor" else method
        for name, method in labeler.methods_.items()
    }
    changed = labeler.with_options()
    changed.methods_, changed.unary_model_ = methods, replace(labeler.unary_model_, floor=None)
    return changed


def evidence_named(name: str) -> Evidence:
    """The function ``MODULE:NAME``.

    Raises
    ------
    ConfigError
        There is no such module, or nothing of that name in it.
    """
    module, _, attribute = name.partition(":")
    try:
        found: Evidence = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(
            f"--evidence wants MODULE:NAME of a function of a map, its graph and its scores; "
            f"{name!r} cannot be found: {error}"
        ) from None
    return found
