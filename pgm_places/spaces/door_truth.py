"""Which gates are doorways according to a labelled map, door by door."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.errors import InputError
from pgm_places.spaces.gates import Gates

__all__ = ["DoorMatch", "DoorScores", "match_doors"]

_LEAST_OVERLAP = 0.3  # the narrowest place beside a door leaf that stands open lies aslant
_LEAST_DOOR_M2 = 0.1
_MARGIN_M = 0.1


@dataclass(frozen=True)
class DoorScores:
    """How well accepted gates are the doors of a map.

    Parameters
    ----------
    doors, found : int
        Doors of the truth, and how many of them an accepted gate matches.
    accepted, right : int
        Accepted gates whose truth is known, and how many of them match a door.
    """

    doors: int
    found: int
    accepted: int
    right: int

    @property
    def recall(self) -> float:
        """Share of the doors that were found; 1 where there is none."""
        return self.found / self.doors if self.doors else 1.0

    @property
    def precision(self) -> float:
        """Share of the accepted gates that are doors; 1 where there is none."""
        return self.right / self.accepted if self.accepted else 1.0


@dataclass(frozen=True, eq=False)
class DoorMatch:
    """Gates and the doors of a labelled map.

    Parameters
    ----------
    door : (G,) int64
        Door that each gate matches, -1 for none.
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
        """The scores of the gates that are accepted (G,) bool.

        Doors under 0.1 m2 need not be found: slips of the pen.
        """
        taken = np.asarray(accepted)
        if taken.shape != self.door.shape or taken.dtype != np.bool_:
            raise InputError(
                f"accepted must be booleans, one per gate ({len(self.door)}), got {taken.dtype} of "
                f"shape {taken.shape}"
            )
        counted = self.door_m2 >= _LEAST_DOOR_M2
        found = np.zeros(len(self.door_m2), np.bool_)
        found[self.door[taken & self.is_doorway]] = True
        judged = taken & (self.known | self.is_doorway)
        return DoorScores(
            doors=int(counted.sum()),
            found=int((found & counted).sum()),
            accepted=int(judged.sum()),
            right=int((judged & self.is_doorway).sum()),
        )


def match_doors(gates: Gates, labels: ArrayLike, doorway: int) -> DoorMatch:
    """The door that each gate matches.

    A door is a piece of free cells labelled ``doorway`` that hang together by sides or corners. A
    gate matches where the cells in its rectangle, 0.1 m larger at every end, and those of the door
    overlap by at least three tenths of the smaller of the two.

    Parameters
    ----------
    gates : Gates
    labels : (H, W) int
        Label of each cell, -1 where not known.
    doorway : int
        The label of doorways.
    """
    from pgm_places.maps._component_kernels import label_components

    grid = gates.segmentation.watershed.grid
    raster = label_raster("labels", labels, grid.shape)
    is_door = np.where((raster == doorway) & grid.free, np.int8(0), np.int8(-1))
    piece = np.empty(grid.shape, np.int32)
    count = label_components(is_door, True, np.empty(piece.size, np.int32), piece)
    size = np.bincount(piece[piece >= 0], minlength=count)
    door, known = np.full(len(gates), -1), np.zeros(len(gates), np.bool_)
    for g, gate in enumerate(gates):
        r, c = gate.cells(grid, wider_m=_MARGIN_M, deeper_m=_MARGIN_M).T
        if not len(r):
            continue
        inside = piece[r, c]
        overlap = np.bincount(inside[inside >= 0], minlength=count)
        share = overlap / np.maximum(np.minimum(size, len(r)), 1)
        if count and share.max() >= _LEAST_OVERLAP:
            door[g] = int(share.argmax())
        known[g] = 2 * (raster[r, c] >= 0).sum() >= len(r)
    return DoorMatch(door, known, np.asarray(size * grid.resolution_m**2, np.float64))
