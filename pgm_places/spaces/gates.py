"""Gates: oriented rectangles at narrow openings between segments, some of which are doorways."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._core import distances_to_others, narrowest_chords, width_profiles
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.spaces.openings import Openings, find_openings
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import GATE_FEATURES, GATE_SHAPE_FEATURES, SEGMENT_FEATURES

_FARTHEST = 2.0**40  # a distance in cells beyond every map


@dataclass(frozen=True)
class Gate:
    """An oriented rectangle, the opening between two segments."""

    centre_m: tuple[float, float]  # its centre in the map frame
    heading_rad: float  # the direction of passage in the map frame, in (-pi/2, pi/2]
    width_m: float  # across the heading, from wall to wall
    depth_m: float  # along the heading

    @property
    def corners_m(self) -> NDArray[np.float64]:
        """(4, 2) corners in the map frame, counter-clockwise.

        Examples
        --------
        >>> Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.2).corners_m.round(2).tolist()
        [[1.9, 0.5], [2.1, 0.5], [2.1, 1.5], [1.9, 1.5]]
        """
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2 * [self.depth_m, self.width_m]
        return np.asarray(half @ [[cos, sin], [-sin, cos]] + self.centre_m)

    @property
    def line_m(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Ends of the line through the centre, from wall to wall, in the map frame.

        Examples
        --------
        >>> Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.2).line_m
        ((2.0, 0.5), (2.0, 1.5))
        """
        (x, y), half_m = self.centre_m, self.width_m / 2
        dx, dy = -half_m * float(np.sin(self.heading_rad)), half_m * float(np.cos(self.heading_rad))
        return (x - dx, y - dy), (x + dx, y + dy)

    def contains(
        self, points_m: ArrayLike, *, wider_m: float = 0.0, deeper_m: float = 0.0
    ) -> NDArray[np.bool_]:
        """(n,) whether points (n, 2) of the map frame are inside.

        ``wider_m`` and ``deeper_m`` extend the width and the depth at either end.
        """
        along, across = map(np.abs, self.in_frame_m(points_m))
        inside = (along <= self.depth_m / 2 + deeper_m) & (across <= self.width_m / 2 + wider_m)
        return np.asarray(inside)

    def distance_m(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """(n,) distance of points (n, 2) of the map frame from the rectangle; 0 inside.

        Examples
        --------
        >>> Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.5).distance_m([[2, 1.5], [3.25, 1]])
        array([0., 1.])
        """
        along, across = map(np.abs, self.in_frame_m(points_m))
        beyond = np.maximum(along - self.depth_m / 2, 0), np.maximum(across - self.width_m / 2, 0)
        return np.asarray(np.hypot(*beyond))

    def in_frame_m(self, points_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(n,) signed distances of points (n, 2) from the centre, along the heading and across."""
        offset = np.asarray(points_m, np.float64).reshape(-1, 2) - self.centre_m
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return offset @ [cos, sin], offset @ [-sin, cos]

    def cells(
        self, grid: OccupancyGrid, *, wider_m: float = 0.0, deeper_m: float = 0.0
    ) -> NDArray[np.int64]:
        """(n, 2) row and column of the free cells with their centres inside, in row-major order."""
        reach = np.hypot(self.width_m / 2 + wider_m, self.depth_m / 2 + deeper_m)
        low, high = grid.cells_at_m([self.centre_m])[0] + np.array([[-1], [1]]) * (
            int(min(reach / grid.resolution_m, _FARTHEST)) + 1
        )
        low, high = np.maximum(low, 0), np.minimum(high + 1, grid.shape)
        if (low >= high).any():
            return np.empty((0, 2), np.int64)
        part = grid.cells[low[0] : high[0], low[1] : high[1]]
        cells = np.argwhere(part == FREE) + low
        inside = self.contains(grid.cell_centres_m(cells), wider_m=wider_m, deeper_m=deeper_m)
        return np.asarray(cells[inside])


MOST_HALF_WIDTH_M = 1.6
"""Openings with more clearance than this are not gates."""

LEAST_WIDTH_M = 0.2
"""Narrower gaps are not gates, such as between a wall and a table leg."""

# Chords are tried every 7.5 degrees.
N_DIRECTIONS = 24

OFFSETS_M = np.arange(-15, 16) / 10
"""Positions of the width profile: up to 1.5 m before and behind a gate."""

_LONGEST_M = 3.0  # length limit of a chord on each side

# A gate's depth ends where the passage is wider than its narrowest width by this much.
_WIDER, _WIDER_M = 1.25, 0.1

# Largest depth of gates at cuts, where nothing narrows; walls are rarely thicker.
_MOST_DEPTH_AT_CUTS_M = 0.4

# Largest distance to other gates as a feature, and radius within which they are counted.
_FARTHEST_M, _NEAR_M = 10.0, 3.0


@dataclass(frozen=True, eq=False)
class Gates:
    """The candidate gates of a map, sorted by the segments on either side."""

    segmentation: Segmentation  # the segmentation of the map; gates belong to its finest scale
    openings: Openings  # the G gaps, split at obstacles that segmentation ignores
    centre_m: NDArray[np.float64]  # (G, 2)
    # heading_rad, width_m, depth_m: (G,) see :class:`~pgm_places.spaces.gates.Gate`
    heading_rad: NDArray[np.float64]
    width_m: NDArray[np.float64]
    depth_m: NDArray[np.float64]
    # (G, 31) width of the free space from 1.5 m before to 1.5 m behind, every 0.1 m; wider side
    # last
    profile_m: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.openings)

    def __getitem__(self, index: int) -> Gate:
        x, y = self.centre_m[index].tolist()
        sizes = (self.heading_rad, self.width_m, self.depth_m)
        return Gate((x, y), *(float(values[index]) for values in sizes))

    def __iter__(self) -> Iterator[Gate]:
        return (self[index] for index in range(len(self)))

    @property
    def segments(self) -> NDArray[np.int32]:
        """(G, 2) the two segments of the finest scale on either side of each."""
        return self.openings.segments

    @property
    def at_cuts(self) -> NDArray[np.bool_]:
        """(G,) which gates lie at a cut of the segmentation, where nothing need narrow."""
        return _at_cuts(self.segmentation, self.openings)


def gate_candidates(segmentation: Segmentation) -> Gates:
    """The openings of the finest scale that are narrow enough to be doorways.

    Their half width at the saddle is under 1.6 m. The width of a gate is the shortest of 24
    chords of free cells through its middle, up to 3 m to either side, and at least 0.2 m; its depth
    is the extent over which the passage is at most 1.25 times as wide plus 0.1 m, at cuts of the
    segmentation at most 0.4 m.

    Examples
    --------
    >>> cells = np.zeros((20, 42), np.int8)
    >>> cells[:, 20:22], cells[8:12, 20:22] = 100, 0  # two rooms, a wall, a door of 0.8 m
    >>> gate = gate_candidates(Segmentation.of(OccupancyGrid(cells, resolution_m=0.2)))[0]
    >>> round(gate.width_m, 3), round(gate.heading_rad, 3)
    (0.8, 0.0)
    """
    grid, openings = segmentation.watershed.grid, _narrow_openings(segmentation)
    longest = _LONGEST_M / grid.resolution_m
    directions = chord_directions()
    chord = np.zeros((len(openings), 4))
    middles = _on_free_cells(grid, openings.centre_rc)
    narrowest_chords(grid.cells, FREE, middles, directions, longest, chord)
    wide = chord[:, 3] * grid.resolution_m >= LEAST_WIDTH_M
    openings, chord = openings[wide], chord[wide]
    along = directions[chord[:, 2].astype(np.int64)]
    profile = np.zeros((len(openings), len(OFFSETS_M)))
    offsets = OFFSETS_M / grid.resolution_m
    width_profiles(grid.cells, FREE, chord[:, :2].copy(), along, offsets, longest, profile)
    depths = _depths(profile * grid.resolution_m, chord[:, 3] * grid.resolution_m)
    most = np.where(_at_cuts(segmentation, openings), _MOST_DEPTH_AT_CUTS_M / 2, np.inf)
    before, behind = np.minimum(depths, most)
    # The normal of a chord with direction (row, column) is (column, -row).
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    shift = (behind - before) / 2 / grid.resolution_m
    heading = np.arctan2(across[:, 0], across[:, 1]) + grid.yaw_rad
    return Gates(
        segmentation,
        openings,
        grid.cell_centres_m(chord[:, :2] + shift[:, None] * across),
        np.pi / 2 - np.mod(np.pi / 2 - heading, np.pi),
        chord[:, 3] * grid.resolution_m,
        before + behind,
        _wider_side_last(profile * grid.resolution_m),
    )


def _narrow_openings(segmentation: Segmentation) -> Openings:
    watershed, finest = segmentation.watershed, segmentation.scales[0]
    segment_of = finest.segment_of[: watershed.basins.count]
    borders = watershed.borders.free_ones()
    openings = find_openings(borders, segment_of[None], watershed.grid.resolution_m)[0]
    return openings[openings.half_width_m < MOST_HALF_WIDTH_M]


def _at_cuts(segmentation: Segmentation, openings: Openings) -> NDArray[np.bool_]:
    """(O,) which openings have their centre next to a cut."""
    cuts, width = segmentation.cuts, segmentation.watershed.grid.shape[1] + 2
    if cuts is None:
        return np.zeros(len(openings), np.bool_)
    centre = np.rint(openings.centre_rc).astype(np.int64)
    around = centre[:, np.newaxis] + np.indices((3, 3)).reshape(2, 9).T - 1
    along = np.array([width, 1])
    return np.asarray(np.isin((around + 1) @ along, (cuts + 1) @ along).any(axis=1))


def chord_directions() -> NDArray[np.float64]:
    """(24, 2) row and column steps of length 1 over half a turn, exact along rows and columns."""
    angle = np.arange(N_DIRECTIONS) * np.pi / N_DIRECTIONS
    directions = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    directions[np.abs(directions) < 1e-12] = 0.0
    return directions


def _on_free_cells(grid: OccupancyGrid, points_rc: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points, moved to the nearest free cell centre (the mean of ties) if they touch a wall."""
    moved = points_rc.copy()
    for g, point in enumerate(points_rc):
        low, high = np.floor(point + 0.5 - 1e-6), np.floor(point + 0.5 + 1e-6)
        if len(_free_between(grid, low, high)) == np.prod(high - low + 1):
            continue
        free = _free_between(grid, low - 1, high + 1)
        if len(free):
            away = ((free - point) ** 2).sum(axis=1)
            moved[g] = free[away <= away.min() + 1e-9].mean(axis=0)
    return moved


def _free_between(
    grid: OccupancyGrid, low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.int64]:
    """(n, 2) the free cells between two corners, inclusive."""
    first = np.maximum(low, 0).astype(np.int64)
    last = np.minimum(high + 1, grid.shape).astype(np.int64)
    part = grid.cells[first[0] : last[0], first[1] : last[1]]
    return np.asarray(np.argwhere(part == FREE) + first)


def _depths(
    profile_m: NDArray[np.float64], width_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(G,) and (G,) the extents of the narrow passage before and behind, at least half a step."""
    middle = profile_m.shape[1] // 2
    narrow = profile_m <= (width_m * _WIDER + _WIDER_M)[:, None]
    before = np.logical_and.accumulate(narrow[:, middle - 1 :: -1], axis=1).sum(axis=1)
    behind = np.logical_and.accumulate(narrow[:, middle + 1 :], axis=1).sum(axis=1)
    step = OFFSETS_M[1] - OFFSETS_M[0]
    return (before + 0.5) * step, (behind + 0.5) * step


def _wider_side_last(profile_m: NDArray[np.float64]) -> NDArray[np.float64]:
    middle = profile_m.shape[1] // 2
    turned = profile_m[:, :middle].sum(axis=1) > profile_m[:, middle + 1 :].sum(axis=1) + 1e-9
    return np.where(turned[:, None], profile_m[:, ::-1], profile_m)


def gate_features(gates: Gates) -> NDArray[np.float64]:
    """(G, 75) the features of every candidate.

    ``GATE_FEATURES`` defines the columns.
    """
    finest = gates.segmentation.scales[0]
    radius = finest.radius_m[gates.segments]
    order = np.argsort(radius, axis=1, kind="stable")
    small, large = np.take_along_axis(gates.segments, order, axis=1).T
    table, names = segment_features(finest), [spec.id for spec in SEGMENT_FEATURES]
    sides = [spec.id for spec in GATE_FEATURES if spec.id.startswith("small_")]
    columns = [names.index(id.removeprefix("small_")) for id in sides]
    shape = _shape_columns(gates, np.sort(radius, axis=1))
    return np.concatenate(
        [
            np.stack([shape[spec.id] for spec in GATE_SHAPE_FEATURES], axis=1),
            table[small][:, columns],
            table[large][:, columns],
            gates.profile_m,
        ],
        axis=1,
    )


def _shape_columns(gates: Gates, radius: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    half_width, width = gates.openings.half_width_m, gates.width_m
    nearest, near = _others(gates)
    parted = [_parted(gates, scale) for scale in (1, 2)]
    heading = gates.heading_rad - gates.segmentation.watershed.grid.yaw_rad
    return {
        "half_width": half_width,
        "width": width,
        "depth": gates.depth_m,
        "border": gates.openings.length_m,
        "saddle_to_small": half_width / radius[:, 0],
        "saddle_to_large": half_width / radius[:, 1],
        "width_to_small": width / (2 * radius[:, 0]),
        "width_to_large": width / (2 * radius[:, 1]),
        "tilt": np.abs(np.sin(2 * heading)),
        "nearest_gate": nearest,
        "gates_near": near,
        "gaps": _same_pair(gates),
        "parted_0.75": parted[0],
        "parted_0.6": parted[1],
    }


def _others(gates: Gates) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(G,) distance to the nearest other candidate, and the number of others nearby."""
    nearest, near = np.full(len(gates), _FARTHEST_M), np.zeros(len(gates))
    if len(gates):
        # Gates beyond the adjacent fields are farther away than the largest distance.
        field = np.floor((gates.centre_m - gates.centre_m.min(axis=0)) / _FARTHEST_M)
        rows, columns = field.astype(np.int64).T
        n_columns = columns.max() + 1
        number = rows * n_columns + columns
        order = np.argsort(number, kind="stable")
        start = np.searchsorted(number[order], np.arange((rows.max() + 1) * n_columns + 1))
        fields = start, order, n_columns
        distances_to_others(gates.centre_m, number, *fields, _NEAR_M, nearest, near)
    return nearest, near


def _same_pair(gates: Gates) -> NDArray[np.float64]:
    _, pair, number = np.unique(gates.segments, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(number[pair.reshape(-1)], np.float64)


def _parted(gates: Gates, scale: int) -> NDArray[np.float64]:
    """(G,) 1 if a scale separates the basins next to the gate, or does not exist."""
    scales = gates.segmentation.scales
    if scale >= len(scales):
        return np.ones(len(gates))
    sides = scales[scale].of_basins(gates.openings.basins)
    return np.asarray(sides[:, 0] != sides[:, 1], np.float64)
