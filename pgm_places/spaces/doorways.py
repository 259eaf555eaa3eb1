"""Doorways: the accepted gates of a map, the places between them, and the true doors."""

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import freeze, label_raster, set_frozen
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps._blocks import factor_between, holders
from pgm_places.maps.components import Components, connected_components, number_type
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gates import Gate, Gates
from pgm_places.spaces.places import Places


@dataclass(frozen=True, eq=False)
class RasterRuns:
    """A run-length encoded raster."""

    shape: tuple[int, int]
    dtype: np.dtype[Any]
    # values and lengths of the runs in each band of rows
    bands: tuple[tuple[NDArray[Any], NDArray[np.int32]], ...]

    @classmethod
    def of(cls, raster: NDArray[Any]) -> Self:
        """The runs of a raster (H, W)."""
        shape = (raster.shape[0], raster.shape[1])
        return cls(
            shape, raster.dtype, tuple(_runs(raster[rows].ravel()) for rows in bands_of_rows(shape))
        )

    def raster(self) -> NDArray[Any]:
        """(H, W) the decoded raster, not cached."""
        raster_of_runs = np.empty(self.shape, self.dtype)
        for rows, (values, lengths) in zip(bands_of_rows(self.shape), self.bands, strict=True):
            raster_of_runs[rows] = np.repeat(values, lengths).reshape(-1, self.shape[1])
        return raster_of_runs


def _runs(flat: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int32]]:
    starts = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    starts = np.concatenate([[0], starts])
    return flat[starts], np.diff(starts, append=len(flat)).astype(np.int32)


@dataclass(frozen=True, eq=False)
class Doorways:
    """The gates of a map that are accepted as doorways, and the places between them."""

    grid: OccupancyGrid  # the map
    gates: tuple[Gate, ...]  # the doorways, as rectangles in the map frame
    probability: NDArray[np.float64]  # (G,) probability that each is a doorway
    # (H, W) number of each cell's place, -1 for none, in the smaller type if possible. It is stored
    # run-length encoded: each access decodes a new raster.
    place: NDArray[np.int16] | NDArray[np.int32]
    removed: tuple[Gate, ...] = ()  # would be doorways but for observed labels

    def __post_init__(self) -> None:
        if self.probability.shape != (len(self.gates),):
            raise InputError(
                f"probability must hold one number per gate ({len(self.gates)}), got shape "
                f"{self.probability.shape}"
            )
        if self.place.shape != self.grid.shape:
            raise InputError(
                f"place must have the map's shape {self.grid.shape}, got {self.place.shape}"
            )
        set_frozen(self, _runs=RasterRuns.of(self.place))
        object.__delattr__(self, "place")

    def __getattr__(self, name: str) -> NDArray[Any]:
        """``place``, decoded from its runs."""
        if name != "place" or "_runs" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        raster: NDArray[Any] = self.__dict__["_runs"].raster()
        return raster

    def __len__(self) -> int:
        return len(self.gates)

    @classmethod
    def of(cls, places: Places, probability: NDArray[np.float64]) -> Self:
        """The accepted gates between places.

        ``probability`` (G,): probability of each candidate, accepted or not.
        """
        taken = np.flatnonzero(places.accepted)
        place = places.segments.raster(number_type(places.segments.count))
        return cls(
            places.gates.segmentation.watershed.grid,
            tuple(places.gates[int(g)] for g in taken),
            freeze(np.asarray(probability, np.float64)[taken]),
            place,
        )

    def with_known(self, gates: Sequence[Gate]) -> Self:
        """The doorways with further ones of probability 1."""
        probability = np.append(self.probability, np.ones(len(gates)))
        return replace(self, gates=(*self.gates, *gates), probability=freeze(probability))

    def place_on(self, grid: OccupancyGrid) -> NDArray[np.int16] | NDArray[np.int32]:
        """(H, W) the place at each cell centre of the same map at another resolution, -1 for none.

        InputError: the map is in another frame, or of another size.
        """
        if grid.origin_xy_m != self.grid.origin_xy_m or grid.yaw_rad != self.grid.yaw_rad:
            raise InputError(
                f"doorways were found in a map with its origin at {self.grid.origin_xy_m} and yaw "
                f"{self.grid.yaw_rad:g}, but the map has {grid.origin_xy_m} and {grid.yaw_rad:g}"
            )
        if grid.shape == self.grid.shape and grid.resolution_m == self.grid.resolution_m:
            return self.place
        sizes_m = np.multiply(
            [self.grid.shape, grid.shape], [[self.grid.resolution_m], [grid.resolution_m]]
        )
        coarser_m = max(self.grid.resolution_m, grid.resolution_m)
        if (np.abs(sizes_m[0] - sizes_m[1]) > 1.5 * coarser_m).any():
            raise InputError(
                f"doorways were found in a map of {sizes_m[0, 0]:g} x {sizes_m[0, 1]:g} m, but the "
                f"map has {sizes_m[1, 0]:g} x {sizes_m[1, 1]:g} m"
            )
        factor = factor_between(grid.resolution_m, self.grid.resolution_m)
        # Only cells of the last blocks lie outside: they use the nearest row and column.
        rows, columns = (
            np.minimum(holders(np.arange(n), factor), last - 1)
            for n, last in zip(grid.shape, self.grid.shape, strict=True)
        )
        return np.asarray(self.place[np.ix_(rows, columns)])


_LEAST_OVERLAP = 0.3  # the narrowest chord next to an open door leaf is oblique
_LEAST_DOOR_M2 = 0.1
_MARGIN_M = 0.1

DECISIVE_SHARE = 0.5
"""Share of a gate's cells that labels must cover to decide on it."""

# Paint beside a doorway may overlap it by this share.
_OVERLAP = 0.1


@dataclass(frozen=True)
class DoorScores:
    """How well accepted gates, or painted doorways, match the doors of a map."""

    # doors, found: number of true doors, and of true doors that an accepted gate matches
    doors: int
    found: int
    # accepted, right: number of accepted gates with known truth, and of those gates that match a
    # door
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
    """Gates and the doors of a labelled map."""

    door: NDArray[np.int64]  # (G,) door matched by each gate, -1 for none
    known: NDArray[np.bool_]  # (G,) whether at least half of the gate's free cells are labelled
    door_m2: NDArray[np.float64]  # (D,) area of each door

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

    ``labels`` (H, W): label of each cell, -1 where unknown. ``doorway``: the label of doorways.
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

    ``painted`` (H, W): the method's label of each cell, -1 for none. ``labels`` (H, W): label of
    each cell, -1 where unknown. ``doorway``: the label of doorways.

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


def partly_covered(
    doorways: Doorways, labels: ArrayLike, doorway: int
) -> tuple[tuple[Gate, float], ...]:
    """The doorways that other labels cover, but too little to remove them, and the covered shares.

    ``labels`` (H, W): observed label of each cell, -1 for none. ``doorway``: the label of doorways.

    Examples
    --------
    >>> grid = OccupancyGrid(np.zeros((4, 10), np.int8), resolution_m=0.5)
    >>> gate = Gate((2.25, 1.0), 0.0, width_m=2.0, depth_m=0.5)
    >>> doorways = Doorways(grid, (gate,), np.ones(1), np.zeros(grid.shape, np.int16))
    >>> labels = np.full(grid.shape, -1)
    >>> labels[0] = 0
    >>> [share for _, share in partly_covered(doorways, labels, doorway=1)]
    [0.25]
    """
    raster = label_raster("labels", labels, doorways.grid.shape)
    relabelled = (raster >= 0) & (raster != doorway)

    def share(gate: Gate, margin_m: float) -> float:
        cells = gate.cells(doorways.grid, wider_m=margin_m, deeper_m=margin_m)
        return float(relabelled[tuple(cells.T)].mean()) if len(cells) else 0.0

    covered = [(gate, share(gate, _MARGIN_M)) for gate in doorways.gates]
    return tuple(
        (gate, covered_share)
        for gate, covered_share in covered
        if covered_share < DECISIVE_SHARE and share(gate, 0.0) >= _OVERLAP
    )


def unmatched_doors(
    gates: Gates, match: DoorMatch, labels: ArrayLike, doorway: int
) -> tuple[Gate, ...]:
    """A gate for each door that no candidate matches: the rectangle around its cells.

    The passage is across the longer side of the rectangle, along the main axis of the cells.

    ``match``: of these gates and labels. ``labels`` (H, W): label of each cell, -1 where unknown.
    ``doorway``: the label of doorways.
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
        known[g] = (raster[r, c] >= 0).sum() >= DECISIVE_SHARE * len(r)
    return DoorMatch(door, known, np.asarray(size * grid.resolution_m**2, np.float64))
