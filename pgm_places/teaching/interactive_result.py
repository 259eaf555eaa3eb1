"""What teaching gives back: labels before and after the graph, places, and the labeler itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gate import Gate
from pgm_places.teaching.paint import Paint
from pgm_places.topology.checks import PlaceCheck, places_to_check
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.unary.map_model import CellScores

# A place of which so much is painted needs no further answer.
ANSWERED = 0.75


@dataclass(frozen=True, eq=False)
class InteractiveResult:
    """A map labelled by what a labeler knows and by paint.

    Parameters
    ----------
    labelled : LabelledPlaces
        The labels and probabilities after the graph.
    unary : LabelledPlaces
        Those of each cell alone, before the graph; painted cells have the label of their paint.
    topology : TopologicalMap
        Regions with names and probabilities, and how they are connected.
    paint : Paint
        What was painted.
    labeler : PlaceLabeler
        What labelled the map: the given labeler, or the one that has learned the paint.
    scores : CellScores
        What the labeler's lists and networks make of each cell that was labelled.
    seconds : float
        From the call to the result.
    by_method : mapping of str to callable, optional
        What the labeler's other methods make of the same scores and the same paint, each labelled
        when it is first asked for.
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
        """The K classes that labels and probabilities stand for."""
        return self.labelled.label_names

    @property
    def labels(self) -> NDArray[np.int16]:
        """(H, W) label of each free cell, -1 elsewhere; painted cells as painted."""
        return self.labelled.labels

    @property
    def unary_labels(self) -> NDArray[np.int16]:
        """(H, W) the label that each cell gets alone, before the graph."""
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
        """The doorways found as gates, each with its probability; painted ones are certain."""
        doorways = self.labelled.doorways
        if doorways is None:
            return ()
        return tuple(zip(doorways.gates, doorways.probability.tolist(), strict=True))

    @cached_property
    def checks(self) -> list[PlaceCheck]:
        """Where to look: places by doubt times area, those with most of it first."""
        return places_to_check(self.topology)

    @cached_property
    def open_checks(self) -> list[PlaceCheck]:
        """Those of the places to check that nobody has painted for the most part.

        What is left of a painted place are the doorways at its edge, which are no reason to look
        at it again.
        """
        region = self.topology.region
        n_cells = np.bincount(region.ravel())
        n_painted = np.bincount(region[self.paint.painted], minlength=len(n_cells))
        is_answered = n_painted >= ANSWERED * n_cells
        return [check for check in self.checks if not is_answered[check.place.id]]


def _raster(places: LabelledPlaces) -> NDArray[Any] | None:
    beliefs = places.labeling.beliefs
    return None if beliefs is None else places.on_map(beliefs.astype(np.float32), np.float32(0))
