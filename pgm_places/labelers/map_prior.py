"""MapPrior: label probabilities at positions, from a labelled map."""

from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.errors import InputError, LabelError
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells

# Default weight of the map at one update: the weight of an observation.
WEIGHT = 1.0

# Probability of a cell's label, for labels without probabilities.
CERTAIN = 0.9

# Least probability of a label on the map, so that a drive can contradict it.
LEAST = 0.01


class PositionPrior(Protocol):
    """Interface of label probabilities at positions, for example of a labelled map."""

    def at(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """(T, K) probabilities at positions (T, 2) in metres."""
        ...

    def log_likelihood(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """The log-likelihood of each label, from probabilities (..., K) of :meth:`at`."""
        ...


class MapPrior:
    """Label probabilities at positions, from a labelled map.

    A position adds ``weight * (log p(l | cell) - log share(l))`` to the log-likelihoods of a step,
    where ``share(l)`` is the label's share of the map. Positions outside the map, or on cells
    without a label, add nothing.

    Parameters
    ----------
    grid : OccupancyGrid
        The map, in the frame of the poses.
    probabilities : (H, W, K) float
        Probability of each label at each cell; 0 for all labels of unlabelled cells.
    weight : float
        Above 0: weight of the map at one update, relative to an observation.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, -1]], resolution_m=1.0)
    >>> prior = MapPrior.of_labels(grid, [[0, 0, 1, -1]], 2)
    >>> prior.at([[0.5, 0.5], [2.5, 0.5], [3.5, 0.5], [9.0, 9.0]]).round(2).tolist()
    [[0.9, 0.1], [0.1, 0.9], [0.63, 0.37], [0.63, 0.37]]
    """

    def __init__(
        self, grid: OccupancyGrid, probabilities: ArrayLike, *, weight: float = WEIGHT
    ) -> None:
        table = np.asarray(probabilities, np.float32)
        if table.ndim != 3 or table.shape[:2] != grid.shape or not table.shape[2]:
            raise InputError(
                f"probabilities must have shape ({grid.shape[0]}, {grid.shape[1]}, K) like the "
                f"map, got {table.shape}"
            )
        if not weight > 0:
            raise InputError(f"weight must be above 0, got {weight}")
        total = table.sum(axis=2)
        if not (np.isfinite(total).all() and table.min(initial=0.0) >= 0):
            raise InputError("probabilities must be at least 0 and finite")
        known = total > 0
        if not known.any():
            raise LabelError("no cell of the labelled map has a label")
        self.grid, self.weight = grid, float(weight)
        rows = np.maximum(table[known] / total[known, None], LEAST)
        self.rows: NDArray[np.float32] = rows / rows.sum(axis=1, keepdims=True)
        """(N, K) label probabilities of the labelled cells."""
        self.number: NDArray[np.int32] = np.full(grid.shape, -1, np.int32)
        """(H, W) row of each cell, -1 for unlabelled cells."""
        self.number[known] = np.arange(len(rows))
        self.shares: NDArray[np.float64] = self.rows.mean(axis=0, dtype=np.float64)
        """(K,) share of each label on the map."""
        self.shares /= self.shares.sum()

    @classmethod
    def of_labels(cls, grid: OccupancyGrid, labels: ArrayLike, n_labels: int) -> Self:
        """A prior from labels (H, W) without probabilities, -1 for unlabelled cells."""
        raster = label_raster("labels", labels, grid.shape, n_labels=n_labels)
        rest = (1.0 - CERTAIN) / max(n_labels - 1, 1)
        table = np.full((n_labels + 1, n_labels), rest, np.float32)  # the last row is for -1
        np.fill_diagonal(table, CERTAIN)
        table[-1] = 0.0
        return cls(grid, table[raster])

    @classmethod
    def of_places(cls, places: LabelledPlaces) -> Self:
        """A prior from a result of :func:`pgm_places.labelling.label.label_map`."""
        beliefs = places.labeling.beliefs
        if beliefs is None:
            return cls.of_labels(places.grid, places.labels, len(places.label_names))
        return cls(places.grid, places.on_map(np.float32(beliefs), 0.0))

    def check_labels(self, label_names: Sequence[str]) -> None:
        """Raise LabelError unless the number of labels is the map's."""
        if len(label_names) != len(self.shares):
            raise LabelError(
                f"the labelled map has {len(self.shares)} labels, but the model has "
                f"{len(label_names)}: {', '.join(label_names)}"
            )

    def at(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """(T, K) probabilities at positions (T, 2); the labels' shares on unlabelled cells."""
        number = at_cells(self.number, self.grid.cells_at_m(positions_m), -1)
        return np.where((number >= 0)[:, None], self.rows[number], self.shares)

    def log_likelihood(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """The log-likelihood of each label, from probabilities (..., K) of :meth:`at`."""
        return np.asarray(self.weight * (np.log(probabilities) - np.log(self.shares)))
