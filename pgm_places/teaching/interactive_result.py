"""InteractiveResult: labels before and after inference, places, and the labeler."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gates import Gate
from pgm_places.teaching.paint import Paint
from pgm_places.topology.checks import PlaceCheck, places_to_check
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.unary.map_model import CellScores

# A place whose painted share is at least this is not to be checked again.
ANSWERED = 0.75


@dataclass(frozen=True, eq=False)
class InteractiveResult:
    """A map labelled by a labeler and by paint.

    Parameters
    ----------
    labelled : LabelledPlaces
        The labels and probabilities after the graph.
    unary : LabelledPlaces
        Those of each cell alone, before the graph; painted cells have the label of their paint.
    topology : TopologicalMap
        Regions with names and probabilities, and how they are connected.
    paint : Paint
        The paint.
    labeler : PlaceLabeler
        The labeler that labelled the map: the given one, or the one trained on the paint.
    scores : CellScores
        The scores of each labelled cell by the labeler's lists and networks.
    seconds : float
        From the call to the result.
    by_method : mapping of str to callable, optional
        The labels by the labeler's other methods from the same scores and paint, computed at the
        first request.
    """

    labelled: LabelledPlaces
    unary: LabelledPlaces
    topology: TopologicalMap
    paint: Paint
    labeler: PlaceLabeler
    scores: CellScores
    seconds: float
    by_method: Mapping[str, Callable[[], LabelledPlaces]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"InteractiveResult({self.paint}; {self.topology}; {self.seconds:.1f} s)"

    @property
    def grid(self) -> OccupancyGrid:
        """The map."""
        return self.labelled.grid

    @property
    def label_names(self) -> tuple[str, ...]:
        """The K classes of labels and probabilities."""
        return self.labelled.label_names

    @property
    def labels(self) -> NDArray[np.int16]:
        """(H, W) label of each free cell, -1 elsewhere; painted cells as painted."""
        return self.labelled.labels

    @property
    def unary_labels(self) -> NDArray[np.int16]:
        """(H, W) the label of each cell before graph inference."""
        return self.unary.labels

    @cached_property
    def probabilities(self) -> NDArray[np.float32] | None:
        """(H, W, K) probability of each label after the graph, 0 outside free cells.

        None if the method gives none. For single cells of a huge map use
        ``labelled.labeling.beliefs`` with ``labelled.layout``.
        """
        return _raster(self.labelled)

    @cached_property
    def unary_probabilities(self) -> NDArray[np.float32] | None:
        """(H, W, K) probability of each label before the graph, 0 outside free cells."""
        return _raster(self.unary)

    @property
    def gates(self) -> tuple[tuple[Gate, float], ...]:
        """The accepted gates, each with its probability; painted ones are certain."""
        doorways = self.labelled.doorways
        if doorways is None:
            return ()
        return tuple(zip(doorways.gates, doorways.probability.tolist(), strict=True))

    @cached_property
    def checks(self) -> list[PlaceCheck]:
        """The places to check, by descending doubt times area."""
        return places_to_check(self.topology)

    @cached_property
    def open_checks(self) -> list[PlaceCheck]:
        """The places to check, without places that are mostly painted.

        The unpainted rest of a painted place are the doorways at its edge, which need no check.
        """
        region = self.topology.region
        n_cells = np.bincount(region.ravel())
        n_painted = np.bincount(region[self.paint.painted], minlength=len(n_cells))
        is_answered = n_painted >= ANSWERED * n_cells
        return [check for check in self.checks if not is_answered[check.place.id]]


def _raster(places: LabelledPlaces) -> NDArray[Any] | None:
    beliefs = places.labeling.beliefs
    return None if beliefs is None else places.on_map(beliefs.astype(np.float32), np.float32(0))
