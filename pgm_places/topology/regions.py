"""Regions of a labelled map with area, outline and anchor, and the connections between them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen_copy, require_shape
from pgm_places._core import mark_deepest
from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps.components import Components, squared_clearance
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells
from pgm_places.spaces.gates import Gate
from pgm_places.topology.outlines import outlines

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Steps to half of a cell's neighbours; the other half would repeat the pairs."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Pairs of pieces that share a border."""

    pairs: NDArray[np.int32]  # (C, 2) piece numbers, the smaller first, sorted
    # (C,) number of cell sides along the border of each pair; 0 if they touch only at corners
    sides: NDArray[np.int64]
    corners: NDArray[np.int64]  # (C,) number of cell corners at which they touch diagonally


@dataclass(frozen=True, eq=False)
class Meetings:
    """Adjacent cells of different pieces along one of ``STEPS``, row by row."""

    # rows and columns of the first cells; each second cell is one step further
    cells_rc: tuple[NDArray[np.int64], NDArray[np.int64]]
    keys: NDArray[np.int64]  # (M,) ``first R + second``, the smaller piece first


def meetings(piece: NDArray[np.int32], count: int) -> list[Meetings]:
    """For each step, the meetings of pieces in a raster (H, W) with -1 for cells without one."""
    return [_along(piece, count, down, right) for down, right in STEPS]


def _along(piece: NDArray[np.int32], count: int, down: int, right: int) -> Meetings:
    height, width = piece.shape
    start, stop = max(0, -right), width - max(0, right)
    bands = []
    for rows in bands_of_rows((height - down, width)):  # bounds the memory for huge maps
        first = piece[rows, start:stop]
        second = piece[rows.start + down : rows.stop + down, start + right : stop + right]
        # Few cells lie at a border; NumPy finds them in one dimension several times as fast.
        r, c = np.divmod(np.flatnonzero(first != second), max(stop - start, 1))
        pair = np.stack([first[r, c], second[r, c]]).astype(np.int64)
        low, high = pair.min(axis=0), pair.max(axis=0)
        inside = low >= 0
        bands.append((r[inside] + rows.start, c[inside] + start, (low * count + high)[inside]))
    bands.append((np.zeros(0, np.int64),) * 3)
    r, c, keys = (np.concatenate(part) for part in zip(*bands, strict=True))
    return Meetings((r, c), keys)


def contacts(piece: NDArray[np.int32], count: int) -> Contacts:
    """The borders between the pieces of a raster (H, W), -1 for cells without a piece."""
    return contacts_at(meetings(piece, count), count)


def contacts_at(met: Sequence[Meetings], count: int) -> Contacts:
    """The borders of pieces from their meetings."""
    keys_of = [item.keys for item in met]
    sides, side_counts = np.unique(np.concatenate(keys_of[:2]), return_counts=True)
    corners, corner_counts = np.unique(np.concatenate(keys_of[2:]), return_counts=True)
    keys = np.union1d(sides, corners)
    lengths = np.zeros((2, len(keys)), np.int64)
    lengths[0, np.searchsorted(keys, sides)] = side_counts
    lengths[1, np.searchsorted(keys, corners)] = corner_counts
    pairs = np.stack([keys // max(count, 1), keys % max(count, 1)], axis=1).astype(np.int32)
    return Contacts(pairs, lengths[0], lengths[1])


HALL, CORRIDOR = "hall", "corridor"

# Closed rings (n, 2) of x, y in metres: the outline counter-clockwise, holes clockwise.
Polygon = tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, eq=False)
class Region:
    """A place: connected cells of one label.

    Parameters
    ----------
    id : int
        At least 1; stable from run to run while the region can be recognised.
    name : str
        Its name, unique on the map.
    label : str
        Its class.
    area_m2 : float
        Area of its cells.
    perimeter_m : float
        Length of its simplified outline, including holes.
    confidence : float or None
        Mean probability of its label over its cells, if probabilities are known.
    box_m : (float, float, float, float)
        Smallest x, smallest y, largest x, largest y of its outline in the map frame.
    anchor_m : (float, float)
        Centre of the largest circle inside it: a point of the region, never in a wall.
    clearance_m : float
        Clearance of the anchor: the distance to the nearest cell that is not free.
    polygons : tuple of polygons
        Its outline in the map frame, one polygon per part connected by sides of cells.
    gate : Gate or None
        For a doorway that is a gate, its rectangle; the confidence is the gate's probability.
    probabilities : tuple of float or None
        Mean probability of each of the map's labels over its cells, if known.
    hall : float or None
        Mean probability that its cells lie in a hall, if halls are shown as corridors and it is
        known; a share of the probability of ``corridor``.
    """

    id: int
    name: str
    label: str
    area_m2: float
    perimeter_m: float
    confidence: float | None
    box_m: tuple[float, float, float, float]
    anchor_m: tuple[float, float]
    clearance_m: float
    polygons: tuple[Polygon, ...]
    gate: Gate | None = None
    probabilities: tuple[float, ...] | None = None
    hall: float | None = None

    def __repr__(self) -> str:  # without the outline, which fills a screen
        size = f"area_m2={self.area_m2:.1f}"
        return f"Region(id={self.id}, name={self.name!r}, label={self.label!r}, {size})"

    @property
    def is_likely_hall(self) -> bool:
        """Whether it is shown as a corridor, but is more probably a hall than another corridor."""
        if self.label != CORRIDOR or self.hall is None or self.confidence is None:
            return False
        return self.hall > self.confidence / 2


def extent(region: Region) -> str:
    """The bounding box of a region in the map frame, for messages."""
    left, bottom, right, top = region.box_m
    return f"x {left:.2f} to {right:.2f} m, y {bottom:.2f} to {top:.2f} m"


def deepest_cells(piece: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
    """(H, W) mask of the cells of each piece with the largest distance from its edge."""
    piece = np.ascontiguousarray(piece, np.int32)
    deepest = np.empty(piece.shape, np.bool_)
    depth = squared_clearance(edges(piece))
    mark_deepest(piece, depth, np.full(count, -1, np.int32), deepest)
    return deepest


def edges(piece: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(H, W) mask of cells that share a side with another piece, no piece, or the outside."""
    edge = np.ones(piece.shape, np.bool_)
    for r in range(1, len(piece) - 1):  # row by row, without another raster
        row, inside = piece[r, 1:-1], edge[r, 1:-1]
        np.not_equal(row, piece[r - 1, 1:-1], out=inside)
        inside |= row != piece[r + 1, 1:-1]
        inside |= row != piece[r, :-2]
        inside |= row != piece[r, 2:]
    return edge


def describe_regions(
    pieces: Components,
    grid: OccupancyGrid,
    label_names: Sequence[str],
    clearance: NDArray[np.int32],
    *,
    ids: Sequence[int],
    names: Sequence[str],
    probabilities: NDArray[np.float64] | None = None,
    halls: NDArray[np.float64] | None = None,
    gates: Sequence[tuple[Gate, float] | None] | None = None,
    anchors_m: Mapping[int, tuple[float, float]] | None = None,
    deepest: NDArray[np.bool_] | None = None,
    tolerance: float = 1.5,
) -> list[Region]:
    """A region per piece, in the order of the pieces.

    ``grid``: the map of the pieces; only its frame is used. ``clearance`` (H, W): squared distance
    in cells to the nearest cell that is not free. ``ids``, ``names``: one per piece.
    ``probabilities`` (P, K): mean probability of each label in each piece, NaN where it is unknown.
    ``halls`` (P,): mean probability of a hall in each, NaN where it is unknown. ``gates``: the gate
    of each piece, with its probability; None for pieces of places. ``anchors_m``: earlier anchors
    by id, which are not moved if they are still inside. ``deepest`` (H, W): result of
    :func:`deepest_cells`, computed before the clearance to save memory on huge maps. ``tolerance``:
    largest distance of an outline from the cells' corners, in cells.
    """
    require_shape("pieces", pieces.piece.shape, grid.shape, of="the map's")
    if deepest is None:
        deepest = deepest_cells(pieces.piece, pieces.count)
    anchors = _anchors(pieces, deepest, clearance)
    _keep_anchors(anchors, pieces, grid, ids, anchors_m or {})
    centres = grid.cell_centres_m(anchors)
    regions = []
    for k, outline in enumerate(outlines(pieces.piece, pieces.count, tolerance=tolerance)):
        polygons = tuple(
            tuple(_in_metres(ring, grid) for ring in rings) for rings in outline.polygons
        )
        shell = np.concatenate([rings[0] for rings in polygons])
        low, high = shell.min(axis=0), shell.max(axis=0)
        means = None if probabilities is None else probabilities[k]
        known = None if means is None or np.isnan(means).any() else tuple(means.tolist())
        confidence = None if known is None else known[pieces.label[k]]
        gate, of_gate = (None if gates is None else gates[k]) or (None, None)
        room = np.sqrt(float(clearance[anchors[k, 0], anchors[k, 1]])) - 0.5
        regions.append(
            Region(
                id=int(ids[k]),
                name=names[k],
                label=label_names[pieces.label[k]],
                area_m2=float(pieces.size[k]) * grid.resolution_m**2,
                perimeter_m=outline.length * grid.resolution_m,
                confidence=confidence if of_gate is None else of_gate,
                box_m=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
                anchor_m=(float(centres[k, 0]), float(centres[k, 1])),
                clearance_m=max(0.0, room) * grid.resolution_m,
                polygons=polygons,
                gate=gate,
                probabilities=known,
                hall=None if halls is None or np.isnan(halls[k]) else float(halls[k]),
            )
        )
    return regions


def _anchors(
    pieces: Components, deepest: NDArray[np.bool_], clearance: NDArray[np.int32]
) -> NDArray[np.int64]:
    """(P, 2) the deepest cell of each piece; of equal ones that with the most clearance."""
    cells, piece = np.argwhere(deepest), pieces.piece[deepest]
    order = np.lexsort((-clearance[deepest], piece))
    return cells[order[np.searchsorted(piece[order], np.arange(pieces.count))]]


def _keep_anchors(
    anchors: NDArray[np.int64],
    pieces: Components,
    grid: OccupancyGrid,
    ids: Sequence[int],
    earlier_m: Mapping[int, tuple[float, float]],
) -> None:
    """Move anchors (P, 2) back to earlier positions that are inside their pieces."""
    for k, number in enumerate(ids):
        if number in earlier_m:
            cell = grid.cells_at_m([earlier_m[number]])
            if at_cells(pieces.piece, cell, -1)[0] == k:
                anchors[k] = cell[0]


def _in_metres(ring: NDArray[np.int32], grid: OccupancyGrid) -> NDArray[np.float64]:
    # Corner (row, column) of the raster is half a cell below and left of the cell's centre.
    points: NDArray[np.float64] = frozen_copy(grid.cell_centres_m(ring - 0.5))
    return points


@dataclass(frozen=True)
class Connection:
    """Two adjacent regions."""

    first: int  # first, second: ids of the regions, the smaller first
    second: int
    point_m: tuple[float, float]  # the point of their border with the most clearance
    width_m: float  # diameter of the largest disc that fits there
    border_m: float  # length of their border along sides of cells; 0 if they touch only at corners


@dataclass(frozen=True, eq=False)
class Passages:
    """The passage between each pair of adjacent pieces."""

    pairs: NDArray[np.int32]  # (C, 2) piece numbers, the smaller first, sorted
    # (C,) number of cell sides along their border; 0 if they touch only at corners
    sides: NDArray[np.int64]
    # (C, 2) the point of the border with the most clearance: row and column; integers are cell
    # centres
    middle_rc: NDArray[np.float64]
    # (C,) diameter in cells of the largest disc that fits there: twice the distance to the wall
    width: NDArray[np.float64]


def find_passages(piece: NDArray[np.int32], count: int, clearance: NDArray[np.int32]) -> Passages:
    """The passage between every pair of adjacent pieces.

    ``piece`` (H, W): number of each cell's piece, -1 for none. ``clearance`` (H, W): squared
    distance in cells to the nearest cell that is not free.
    """
    met = meetings(piece, count)
    touching = contacts_at(met, count)
    parts = []
    for (down, right), item in zip(STEPS, met, strict=True):
        r, c = item.cells_rc
        room = np.minimum(clearance[r, c], clearance[r + down, c + right])
        parts.append((item.keys, room, np.stack([r + down / 2, c + right / 2], axis=1)))
    key, room, place = (np.concatenate(part) for part in zip(*parts, strict=True))
    # The most clearance first; ties go to the point nearest to the middle of the border.
    off = _from_the_middle(key, place)
    order = np.lexsort((off, -room, key))
    _, best = np.unique(key[order], return_index=True)
    chosen = order[best]
    width = np.maximum(2 * np.sqrt(room[chosen].astype(np.float64)) - 1, 0.0)
    return Passages(touching.pairs, touching.sides, place[chosen], width)


def _from_the_middle(key: NDArray[np.int64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distance of each position from the mean position of its key."""
    _, group, counts = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(group, axis, len(counts)) / counts for axis in place.T], axis=1)
    return np.asarray(((place - mean[group]) ** 2).sum(axis=1))


def connections_of(
    pieces: Components,
    grid: OccupancyGrid,
    ids: Sequence[int],
    clearance: NDArray[np.int32],
    min_width_m: float = 0.0,
) -> tuple[Connection, ...]:
    """The connections of pieces, by ids; those narrower than ``min_width_m`` are left out.

    ``grid``: the map of the pieces; only its frame is used. ``ids``: one per piece. ``clearance``
    (H, W): squared distance in cells to the nearest cell that is not free.
    """
    passages = find_passages(pieces.piece, pieces.count, clearance)
    middles = grid.cell_centres_m(passages.middle_rc)
    connections = []
    for k, (i, j) in enumerate(passages.pairs.tolist()):
        width_m = float(passages.width[k]) * grid.resolution_m
        if width_m < min_width_m:
            continue
        first, second = sorted((ids[i], ids[j]))
        point_m = (float(middles[k, 0]), float(middles[k, 1]))
        border_m = float(passages.sides[k]) * grid.resolution_m
        connections.append(Connection(first, second, point_m, width_m, border_m))
    return tuple(sorted(connections, key=lambda item: (item.first, item.second)))
