"""Matching gates, or painted doorways, with the doors of a labelled map."""

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.errors import InputError
from pgm_places.maps.components import Components, connected_components
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gate import Gate
from pgm_places.spaces.gates import Gates

_LEAST_OVERLAP = 0.3  # the narrowest chord next to an open door leaf is oblique
_LEAST_DOOR_M2 = 0.1
_MARGIN_M = 0.1


@dataclass(frozen=True)
class DoorScores:
    """How well accepted gates, or painted doorways, match the doors of a map.

    Parameters
    ----------
    doors, found : int
        Number of true doors, and of true doors that an accepted gate matches.
    accepted, right : int
        Number of accepted gates with known truth, and of those gates that match a door.
    """

    doors: int
    found: int
    accepted: int
    right: int

    @classmethod
    def total(cls, items: Iterable["DoorScores"]) -> Self:
        """The scores of several maps together."""
        return cls(
            *(sum(column) for column in zip((0, 0, 0, 0), *map(astuple, items), strict=True))
        )

    @property
    def missed(self) -> int:
        """Doors that no accepted gate matches."""
        return self.doors - self.found

    @property
    def invented(self) -> int:
        """Accepted gates that are not doors."""
        return self.accepted - self.right

    @property
    def recall(self) -> float | None:
        """Recall: share of the doors that are matched; None without doors."""
        return self.found / self.doors if self.doors else None

    @property
    def precision(self) -> float | None:
        """Precision: share of the accepted gates that are doors; None without accepted gates."""
        return self.right / self.accepted if self.accepted else None


@dataclass(frozen=True, eq=False)
class DoorMatch:
    """Gates and the doors of a labelled map.

    Parameters
    ----------
    door : (G,) int64
        Door matched by each gate, -1 for none.
    known : (G,) bool
        Whether at least half of the gate's free cells are labelled.
    door_m2 : (D,) float64
        Area of each door.
    """

    door: NDArray[np.int64]
    known: NDArray[np.bool_]
    door_m2: NDArray[np.float64]

    @property
    def is_doorway(self) -> NDArray[np.bool_]:
        """(G,) whether each gate matches a door."""
        return self.door >= 0

    def scores(self, accepted: ArrayLike) -> DoorScores:
        """The scores of the accepted gates (G,) bool.

        Doors under 0.1 m2 do not count as missed: they are drawing errors.
        """
        taken = np.asarray(accepted)
        if taken.shape != self.door.shape or taken.dtype != np.bool_:
            raise InputError(
                f"accepted must be booleans, one per gate ({len(self.door)}), got {taken.dtype} of "
                f"shape {taken.shape}"
            )
        counted = self.door_m2 >= _LEAST_DOOR_M2
        is_found = np.isin(np.arange(len(self.door_m2)), self.door[taken])
        judged = taken & (self.known | self.is_doorway)
        return DoorScores(
            doors=int(counted.sum()),
            found=int((is_found & counted).sum()),
            accepted=int(judged.sum()),
            right=int((judged & self.is_doorway).sum()),
        )


def match_doors(gates: Gates, labels: ArrayLike, doorway: int) -> DoorMatch:
    """The door matched by each gate.

    A door is a set of free cells labelled ``doorway``, connected by sides or corners. It is matched
    by a gate if the cells of its rectangle, extended by 0.1 m at every end, and those of the door
    overlap by at least three tenths of the smaller of the two.

    Parameters
    ----------
    gates : Gates
    labels : (H, W) int
        Label of each cell, -1 where unknown.
    doorway : int
        The label of doorways.
    """
    return match_gates(gates, gates.segmentation.watershed.grid, labels, doorway)


def match_gates(
    gates: Gates | Sequence[Gate], grid: OccupancyGrid, labels: ArrayLike, doorway: int
) -> DoorMatch:
    """The door matched by each of some gates of a map, by the rule of :func:`match_doors`."""
    inside = (gate.cells(grid, wider_m=_MARGIN_M, deeper_m=_MARGIN_M) for gate in gates)
    return _match(inside, len(gates), grid, labels, doorway)


def match_painted(
    painted: ArrayLike, grid: OccupancyGrid, labels: ArrayLike, doorway: int
) -> DoorMatch:
    """The door matched by each painted doorway, by the rule for gates: for methods without gates.

    A painted doorway is a piece of cells that a method labelled ``doorway``, of at least 0.1 m2:
    smaller doors do not count either.

    Parameters
    ----------
    painted : (H, W) int
        The method's label of each cell, -1 for none.
    grid : OccupancyGrid
    labels : (H, W) int
        Label of each cell, -1 where unknown.
    doorway : int
        The label of doorways.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 0, 0, 0]], resolution_m=0.5)
    >>> truth, found = [[0, 1, 0, 0, 0, 0]], [[0, 1, 1, 0, 1, 0]]
    >>> match = match_painted(found, grid, truth, doorway=1)
    >>> match.scores(np.ones(2, bool))
    DoorScores(doors=1, found=1, accepted=2, right=1)
    """
    pieces = _doors(label_raster("painted", painted, grid.shape), grid, doorway)
    cells = np.argwhere(pieces.piece >= 0)
    order = np.argsort(pieces.piece[cells[:, 0], cells[:, 1]], kind="stable")
    parts = np.split(cells[order], np.cumsum(pieces.size)[:-1])
    large = [part for part in parts if len(part) * grid.resolution_m**2 >= _LEAST_DOOR_M2]
    return _match(large, len(large), grid, labels, doorway)


def unmatched_doors(
    gates: Gates, match: DoorMatch, labels: ArrayLike, doorway: int
) -> tuple[Gate, ...]:
    """A gate for each door that no candidate matches: the rectangle around its cells.

    The passage is across the longer side of the rectangle, along the main axis of the cells.

    Parameters
    ----------
    gates : Gates
    match : DoorMatch
        Of these gates and labels.
    labels : (H, W) int
        Label of each cell, -1 where unknown.
    doorway : int
        The label of doorways.
    """
    grid = gates.segmentation.watershed.grid
    doors = _doors(label_raster("labels", labels, grid.shape), grid, doorway)
    alone = np.setdiff1d(np.arange(doors.count), match.door)
    return tuple(_rectangle(np.argwhere(doors.piece == piece), grid) for piece in alone)


def true_doors(known: LabelledMap, doorway: int) -> tuple[Gate, ...]:
    """The rectangle around the cells of each door of at least 0.1 m2 of a labelled map."""
    doors = _doors(np.asarray(known.labels, np.int16), known.grid, doorway)
    large = np.flatnonzero(doors.size * known.grid.resolution_m**2 >= _LEAST_DOOR_M2)
    return tuple(_rectangle(np.argwhere(doors.piece == n), known.grid) for n in large)


def _rectangle(cells: NDArray[np.int64], grid: OccupancyGrid) -> Gate:
    """The rectangle around cells (n, 2), with the passage across its longer side."""
    points = grid.cell_centres_m(cells)
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]  # by ascending spread: the passage, the width
    along = centred @ axes
    low, high = along.min(axis=0), along.max(axis=0)
    x, y = (points.mean(axis=0) + axes @ ((low + high) / 2)).tolist()
    heading = float(np.arctan2(axes[1, 0], axes[0, 0]))
    depth_m, width_m = (high - low + grid.resolution_m).tolist()
    turned = np.pi / 2 - np.mod(np.pi / 2 - heading, np.pi)  # in (-pi/2, pi/2]
    return Gate((x, y), float(turned), width_m, depth_m)


def _doors(raster: NDArray[np.int16], grid: OccupancyGrid, doorway: int) -> Components:
    """The connected sets of doorway cells."""
    return connected_components((raster == doorway) & grid.free)


def _match(
    candidates: Iterable[NDArray[np.int64]],
    n_candidates: int,
    grid: OccupancyGrid,
    labels: ArrayLike,
    doorway: int,
) -> DoorMatch:
    """The door that each candidate overlaps most; candidates are given by their cells (n, 2)."""
    raster = label_raster("labels", labels, grid.shape)
    doors = _doors(raster, grid, doorway)
    piece, count, size = doors.piece, doors.count, doors.size
    door, known = np.full(n_candidates, -1), np.zeros(n_candidates, np.bool_)
    for g, cells in enumerate(candidates):
        if not len(cells):
            continue
        r, c = cells.T
        inside = piece[r, c]
        overlap = np.bincount(inside[inside >= 0], minlength=count)
        share = overlap / np.maximum(np.minimum(size, len(r)), 1)
        if count and share.max() >= _LEAST_OVERLAP:
            door[g] = int(share.argmax())
        known[g] = 2 * (raster[r, c] >= 0).sum() >= len(r)
    return DoorMatch(door, known, np.asarray(size * grid.resolution_m**2, np.float64))
