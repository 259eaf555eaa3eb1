from itertools import pairwise
from math import inf, pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places._core import cast_rays, write_disc
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.sensing.local_map import HIGHEST, LOWEST, SCAN_NUMBERS, LocalMap, Pose, Window
from pgm_places.sensing.ray_casting import cast_poses
from tests.refusals import refused

AHEAD = np.linspace(-pi / 2, pi / 2, 361)
AROUND = np.linspace(0, 2 * pi, 720, endpoint=False)


def walled_room(side_m: float = 6.0, resolution_m: float = 0.05) -> OccupancyGrid:
    """A square room with a pillar, its corner at the frame's origin."""
    n = round(side_m / resolution_m)
    cells = np.full((n, n), FREE, np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    third = n // 3
    cells[third : third + 6, third : third + 6] = OCCUPIED
    return OccupancyGrid(cells, resolution_m)


def after_turning_around(local: LocalMap, room: OccupancyGrid, where: list[float]) -> None:
    for heading in np.linspace(0, 2 * pi, 16, endpoint=False):
        pose = [*where, heading]
        ranges = cast_poses(room, [pose], AHEAD, max_range_m=30.0)[0]
        local.update(pose, ranges, AHEAD, max_range_m=30.0)


def slow_evidence(
    lengths: NDArray[np.float64], angles: NDArray[np.float64], n: int, x: float, y: float
) -> NDArray[np.int64]:
    """One scan's change per cell by sampling beams finely: 1 ended at, -1 crossed, 0 neither."""
    change = np.zeros((n, n), np.int64)
    for length, angle in zip(lengths, angles, strict=True):
        for at in np.arange(0.0, length, 1e-3):
            change[int(y + at * np.sin(angle)), int(x + at * np.cos(angle))] = -1
    for length, angle in zip(lengths, angles, strict=True):
        change[int(y + length * np.sin(angle)), int(x + length * np.cos(angle))] = 1
    return change


def test_one_scan_marks_ends_occupied_and_what_was_crossed_free() -> None:
    local = LocalMap(size_m=3.2, resolution_m=0.1, robot_radius_m=0.0)
    rng = np.random.default_rng(1)
    angles = rng.uniform(0, 2 * pi, 12)
    ranges = rng.uniform(0.2, 1.3, 12)
    local.update([0.05, 0.05, 0.3], ranges, angles, max_range_m=5.0)
    expected = slow_evidence(ranges / 0.1, angles + 0.3, 32, 16.5, 16.5)
    cells = local.to_grid().cells
    assert (cells[expected == 1] == OCCUPIED).all()
    # Samples a thousandth of a cell apart may miss a corner that a beam just touches.
    differing = cells != np.choose(expected + 1, [FREE, UNKNOWN, OCCUPIED])
    assert differing.sum() <= 3


def test_rays_behind_the_robot_read_what_it_saw_when_it_looked_there() -> None:
    room, local = walled_room(), LocalMap(size_m=16.0)
    after_turning_around(local, room, [1.0, 3.0])
    pose = [1.0, 3.0, 0.7]
    ranges, met = local.cast(pose, AROUND, max_range_m=30.0)
    true = cast_poses(room, [pose], AROUND, max_range_m=30.0)[0]
    assert met.mean() > 0.98
    assert np.quantile(np.abs(ranges - true), 0.95) <= 2 * local.resolution_m


def test_the_window_moves_in_any_direction_without_losing_what_stays_inside() -> None:
    room, local = walled_room(), LocalMap(size_m=20.0)
    after_turning_around(local, room, [3.0, 1.0])
    seen = local.to_grid()
    nothing: NDArray[np.float64] = np.full(len(AHEAD), 30.0)
    for where in ([-3.7, 2.2], [4.1, -2.9], [3.0, 1.0]):
        local.update([*where, 0.0], nothing, AHEAD, max_range_m=30.0)
        now = local.to_grid()
        centres = now.cell_centres_m(np.argwhere(now.occupied))
        rows, columns = seen.cells_at_m(centres).T
        assert len(centres) == seen.occupied.sum()
        assert (seen.cells[rows, columns] == OCCUPIED).all()


def test_what_leaves_the_window_is_forgotten_and_memory_stays_the_same() -> None:
    room, local = walled_room(), LocalMap(size_m=8.0)
    before = local.n_bytes
    after_turning_around(local, room, [3.0, 1.0])
    for x in np.arange(3.0, 30.0, 0.5):  # away, step by step, and back at once
        local.update([x, 1.0, 0.0], np.full(len(AHEAD), 30.0), AHEAD, max_range_m=30.0)
    local.update([3.0, 1.0, 0.0], np.full(len(AHEAD), 30.0), AHEAD, max_range_m=30.0)
    assert not local.to_grid().occupied.any()
    assert local.n_bytes == before == 2 * 160 * 160


def test_evidence_stays_within_its_bounds_however_long_the_robot_stands() -> None:
    local = LocalMap(size_m=6.0, resolution_m=0.1)
    for _ in range(600):  # more scans than fit the byte that numbers them
        local.update([0.0, 0.0, 0.0], np.full(len(AHEAD), 2.0), AHEAD, max_range_m=30.0)
    assert local._evidence.min() == LOWEST
    assert local._evidence.max() == HIGHEST
    for _ in range(10):  # the door at two metres opens
        local.update([0.0, 0.0, 0.0], np.full(len(AHEAD), 2.9), AHEAD, max_range_m=30.0)
    ranges, met = local.cast([0.0, 0.0, 0.0], [0.0], max_range_m=30.0)
    assert met.all() and ranges[0] > 2.7


def test_scans_count_the_same_after_their_numbers_have_begun_anew() -> None:
    """Each scan of one beam has the number that this beam had last time round."""

    def scan(local: LocalMap, beam: int) -> None:
        local.update([0.0, 0.0, headings[beam]], [ranges[beam]], [0.0], max_range_m=5.0)

    rng = np.random.default_rng(3)
    headings, ranges = rng.uniform(0, 2 * pi, SCAN_NUMBERS), rng.uniform(0.2, 1.3, SCAN_NUMBERS)
    local, *alone = (
        LocalMap(size_m=3.2, resolution_m=0.1, robot_radius_m=0.0) for _ in range(SCAN_NUMBERS + 1)
    )
    expected = np.zeros(local._evidence.shape, np.int64)
    for beam, once in enumerate(alone):
        scan(once, beam)
    for _ in range(3):
        for beam, once in enumerate(alone):
            scan(local, beam)
            expected = (expected + once._evidence).clip(LOWEST, HIGHEST)
        assert (local._evidence == expected).all()


def test_beams_without_an_answer_change_nothing() -> None:
    local = LocalMap(size_m=6.0, resolution_m=0.1, robot_radius_m=0.0)
    readings = np.array([np.nan, np.inf, 0.0, -1.0, 5.0, 7.0])
    local.update([0.0, 0.0, 0.0], readings, np.arange(6.0), max_range_m=5.0)
    assert local.to_grid().unknown.all()


@pytest.mark.parametrize(("through_m", "expected"), [(0.0, 0.2), (inf, 5.0)])
def test_unknown_space_ends_rays_or_is_free(through_m: float, expected: float) -> None:
    local = LocalMap(size_m=6.0, resolution_m=0.1, robot_radius_m=0.25, through_unknown_m=through_m)
    local.update([0.0, 0.0, 0.0], [2.0], [0.0], max_range_m=30.0)
    ranges, met = local.cast([0.0, 0.0, 0.0], [pi], max_range_m=5.0)
    assert ranges[0] == pytest.approx(expected, abs=0.1)
    assert not met.any()


def test_an_unused_map_reads_nothing_and_clear_forgets() -> None:
    local = LocalMap(size_m=6.0, resolution_m=0.1)
    assert local.cast([9.0, -4.0, 1.0], [0.0], max_range_m=5.0)[0][0] == 0.0
    local.update([0.0, 0.0, 0.0], [2.0], [0.0], max_range_m=30.0)
    local.clear()
    assert local.to_grid().unknown.all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size_m": 0.0}, "size_m must be"),
        ({"resolution_m": -1.0}, "resolution_m must be"),
        ({"size_m": 0.1}, r"must give 8 to 20000 cells, got 0\.1 / 0\.05 = 2"),
        ({"size_m": 1e6}, r"must give 8 to 20000 cells, got 1e\+06 / 0\.05 = 20000000"),
        ({"size_m": 1e-290, "resolution_m": 1e-291}, "must be positive metres per cell"),
        ({"robot_radius_m": -0.1}, "robot_radius_m must be"),
        ({"through_unknown_m": float("nan")}, "through_unknown_m must be"),
    ],
)
def test_impossible_sizes_are_refused(options: dict[str, float], message: str) -> None:
    refused(InputError, message, LocalMap, **options)
    assert LocalMap(size_m=0.8, resolution_m=0.1).n_cells == 8


@pytest.mark.parametrize("wrap", [(0, 0), (7, 3)])
def test_the_disc_of_the_robot_is_the_cells_whose_centres_it_covers(wrap: tuple[int, int]) -> None:
    n, rng = 12, np.random.default_rng(5)
    rows, columns = np.mgrid[:n, :n]
    for _ in range(20):
        x, y, radius = rng.uniform(-1, n + 1), rng.uniform(-1, n + 1), rng.uniform(0.3, 4)
        before = rng.integers(-9, 9, (n, n)).astype(np.int8)
        window = Window(np.roll(before, wrap, (0, 1)), np.zeros((n, n), np.uint8), *wrap)
        write_disc(window, x, y, radius, -2)
        covered = np.hypot(rows + 0.5 - y, columns + 0.5 - x) <= radius
        wanted = np.where(covered, np.minimum(before, -2), before)
        np.testing.assert_array_equal(window.evidence, np.roll(wanted, wrap, (0, 1)))


@pytest.mark.parametrize("factor", [1, 2, 5])
@pytest.mark.parametrize(("middle", "n"), [((0.3, -0.2), 20), ((3.6, 1.0), 37), ((-3.9, 3.9), 60)])
def test_a_square_of_the_window_is_cut_out_of_its_map_and_coarsened(
    factor: int, middle: tuple[float, float], n: int
) -> None:
    rng = np.random.default_rng(n)
    angles = np.linspace(-pi, pi, 90)
    local = LocalMap(size_m=8.0, resolution_m=0.1)
    for x in np.linspace(-2.0, 1.03, 7):  # the window has moved over its border
        local.update([x, x / 3, x], rng.uniform(0.5, 5.0, 90), angles, max_range_m=4.5)
    position = np.array([1.03, 0.34]) + middle
    whole, found = local.to_grid(), local.square(position, n, factor)
    assert found is not None
    row, column = whole.cells_at_m(position)[0].tolist()
    rows, columns = (slice(max(at - n, 0), at + n) for at in (row, column))
    part = whole.cells[rows, columns]
    for r, c in np.ndindex(*found.shape):
        block = part[r * factor : (r + 1) * factor, c * factor : (c + 1) * factor]
        wanted = OCCUPIED if (block == OCCUPIED).any() else UNKNOWN
        wanted = FREE if wanted == UNKNOWN and (block == FREE).any() else wanted
        assert found.cells[r, c] == wanted
    assert found.shape == tuple(-(-side // factor) for side in part.shape)
    corner = whole.cell_centres_m([[rows.start, columns.start]])[0] - 0.05
    np.testing.assert_allclose(found.origin_xy_m, corner, rtol=0, atol=1e-9)
    assert (found.cells == FREE).any() and (found.cells == OCCUPIED).any()


def test_a_square_outside_the_window_is_none() -> None:
    local = LocalMap(size_m=8.0, resolution_m=0.1)
    local.update([0.0, 0.0, 0.0], [1.0], [0.0], max_range_m=4.5)
    assert local.square([40.0, 0.0], 20, 2) is None
    assert local.square([0.0, -40.0], 20, 2) is None


def slow_ray(
    evidence: NDArray[np.int8], at: tuple[float, float], angle: float, limit: float, through: float
) -> tuple[float, bool]:
    """Length of a ray and whether it met anything: piece by piece between the cells' borders."""
    (x, y), n = at, len(evidence)
    along_x, along_y = np.cos(angle), np.sin(angle)
    borders = [(k - x) / along_x for k in range(n + 1)] + [(k - y) / along_y for k in range(n + 1)]
    ends = sorted({0.0, limit, *(t for t in borders if 0 < t < limit)})
    unknown_from = None
    for begin, end in pairwise(ends):
        middle = (begin + end) / 2
        row, column = int(np.floor(y + middle * along_y)), int(np.floor(x + middle * along_x))
        inside = 0 <= row < n and 0 <= column < n
        value = evidence[row, column] if inside else 0
        if value > 0:
            return begin, True
        if value < 0:
            unknown_from = None
            continue
        unknown_from = begin if unknown_from is None else unknown_from
        if end - unknown_from > through:
            return unknown_from, False
    return limit, False


@pytest.mark.parametrize("wrap", [(0, 0), (5, 2)])
@pytest.mark.parametrize("through", [0.0, 1.3, inf])
def test_rays_through_the_window_end_where_following_them_by_hand_ends(
    wrap: tuple[int, int], through: float
) -> None:
    n, rng = 8, np.random.default_rng(11)
    angles = np.linspace(0.07, 0.07 + 23 * pi / 12, 24)
    for _ in range(12):
        # Mostly free, so that rays reach the first and the last rows and columns.
        parts = [0.45, 0.3, 0.1, 0.1, 0.05]
        evidence = rng.choice([-3, -1, 0, 1, 5], (n, n), p=parts).astype(np.int8)
        x, y = rng.uniform(0.1, n - 0.1, 2)
        heading, limit = rng.uniform(-4, 4), rng.uniform(2, 12)
        window = Window(np.roll(evidence, wrap, (0, 1)), np.zeros((n, n), np.uint8), *wrap)
        length, met = np.empty(len(angles)), np.empty(len(angles), np.bool_)
        cast_rays(window, Pose(x, y, heading), angles, limit, through, length, met)
        wanted = [slow_ray(evidence, (x, y), heading + a, limit, through) for a in angles]
        np.testing.assert_allclose(length, [end for end, _ in wanted], rtol=0, atol=1e-9)
        assert met.tolist() == [hit for _, hit in wanted]


def test_what_stands_in_the_outermost_cells_is_met() -> None:
    evidence = np.full((8, 8), -1, np.int8)
    evidence[[0, 7], :] = evidence[:, [0, 7]] = 4
    window = Window(evidence, np.zeros((8, 8), np.uint8), 0, 0)
    length, met = np.empty(4), np.empty(4, np.bool_)
    quarters = np.array([0.0, pi / 2, pi, 3 * pi / 2])
    cast_rays(window, Pose(4.5, 3.25, 0.0), quarters, 20.0, 0.0, length, met)
    np.testing.assert_allclose(length, [2.5, 3.75, 3.5, 2.25], rtol=0, atol=1e-12)
    assert met.all()


@pytest.mark.parametrize("far", [1.1e7, 1e19, -1e300])
def test_poses_far_away_are_refused(far: float) -> None:
    """Coordinates become whole cells: what does not fit is refused before."""
    local = LocalMap(size_m=4.0, resolution_m=0.1)
    wanted = r"pose must hold metres and radians up to 1e\+07"
    for take in (local.update, local.write):
        refused(InputError, wanted, take, [far, 0.0, 0.0], [1.0], [0.0], max_range_m=5.0)
    refused(InputError, wanted, local.cast, [0.0, far, 0.0], [0.0], max_range_m=5.0)
    refused(InputError, "centre_m must hold metres", local.square, [0.0, far], 4, 1)


@pytest.mark.parametrize("number", [-1, 2**62, 2**63 - 1, 10**30, 0.5, float("nan")])
def test_squares_of_other_numbers_of_cells_are_refused(number: Any) -> None:
    local = LocalMap(size_m=4.0, resolution_m=0.1)
    wanted = "n_cells must be a whole number from 0 to"
    refused(InputError, wanted, local.square, [0.0, 0.0], number, 2)
    wanted = "factor must be a whole number from 1 to"
    refused(InputError, wanted, local.square, [0.0, 0.0], 10, number)


def test_beams_and_discs_of_any_size_end_at_the_window() -> None:
    local = LocalMap(size_m=4.0, resolution_m=0.1, robot_radius_m=0.0)
    local.update([0.0, 0.0, 0.0], [1e300, np.inf], [0.0, 1.0], max_range_m=np.inf)
    grid = local.to_grid()
    assert grid.free[20, 20:].all()
    assert grid.free.sum() == 20
    local = LocalMap(size_m=4.0, resolution_m=0.1, robot_radius_m=1e300)
    local.update([0.0, 0.0, 0.0], [], [], max_range_m=5.0)
    assert local.to_grid().free.all()


def test_ranges_that_are_no_metres_are_refused() -> None:
    local, wanted = LocalMap(), "max_range_m must be a positive number of metres"
    still = [0.0, 0.0, 0.0]
    for reach in (np.nan, 0.0, -1.0, inf):
        refused(InputError, wanted, local.cast, still, [0.0], max_range_m=reach)
        if reach < inf or reach != reach:
            refused(InputError, wanted, local.update, still, [1.0], [0.0], max_range_m=reach)
    wanted = "one value per angle"
    refused(InputError, wanted, local.update, still, [1.0, 2.0], [0.0], max_range_m=30.0)
