"""Door lines: doorways that networks see where no passage narrows, and the gates made of them."""

import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from pgm_places.floor.raster import CELL_M, holders
from pgm_places.floor.view import FloorScores
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gates import Gates, gate_candidates
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary import floor_model as module
from pgm_places.unary import space_model
from pgm_places.unary.floor_model import FloorJudge, FloorModel, door_lines
from pgm_places.unary.space_model import N_SPACE_COLUMNS, SpaceModel
from tests.spaces.floors import grid_of, two_rooms
from tests.unary.test_space_model import random_list

SIDES = ndimage.generate_binary_structure(2, 1)
CORNERS = np.ones((3, 3))


def seen_at(grid: OccupancyGrid, doorway: np.ndarray) -> FloorScores:
    """Networks that say so (h, w) of doorways, in cells of 0.1 m."""
    rows, columns = (holders(n, grid.resolution_m) for n in grid.shape)
    rest = (1 - doorway) / 3
    log_p = np.log(np.stack([rest, rest, doorway, rest], axis=-1)).astype(np.float16)
    return FloorScores(log_p, np.zeros(doorway.shape, np.float16), rows, columns)


def corridor(width_m: float = 1.8, angle: float = 0.0) -> tuple[OccupancyGrid, np.ndarray]:
    """A passage as wide as it is everywhere, 8 m long, and the distance of cells to its middle."""
    r, c = (np.indices((200, 200)) - 99.5) * 0.05
    along = c * np.cos(angle) + r * np.sin(angle)
    across = -c * np.sin(angle) + r * np.cos(angle)
    free = (np.abs(along) < 4) & (np.abs(across) < width_m / 2)
    return grid_of(free, 0.05), np.abs(along)


def doorway_within(half_m: float, along: np.ndarray, likely: float = 0.95) -> np.ndarray:
    """(100, 100) doorways so near the middle, in cells of 0.1 m."""
    nearest = along.reshape(100, 2, 100, 2).mean(axis=(1, 3))
    return np.where(nearest < half_m, likely, 0.01)


def candidates(grid: OccupancyGrid) -> Gates:
    return gate_candidates(Segmentation.of(grid))


def with_lines(judge: FloorJudge, grid: OccupancyGrid) -> Gates:
    return gate_candidates(Segmentation.of(grid, cuts=judge.cuts(candidates(grid))))


def in_cells(lines: np.ndarray, grid: OccupancyGrid) -> np.ndarray:
    found = np.zeros(grid.shape, np.bool_)
    found[tuple(lines.T)] = True
    return found


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, 1.1, np.pi / 2])
@pytest.mark.parametrize("width_m", [0.8, 1.8, 2.4])
def test_a_line_divides_a_passage_that_does_not_narrow(angle: float, width_m: float) -> None:
    grid, along = corridor(width_m, angle)
    gates = candidates(grid)
    line = in_cells(door_lines(gates, seen_at(grid, doorway_within(0.3, along))), grid)
    assert ndimage.label(line, SIDES)[1] == 1, "its cells share sides"
    straight = angle in (0.0, np.pi / 2)
    assert along[line & grid.free].max() < (0.1 if straight else 0.25), "the shortest"
    left = ndimage.label(grid.free & ~line, CORNERS)[0]
    areas = np.bincount(left[left > 0]) * grid.resolution_m**2
    assert (areas > 3 * width_m).sum() == 2, "nobody can go around it"
    assert (grid.free & line).sum() * grid.resolution_m**2 < 0.15 * width_m


def test_a_line_becomes_a_gate_between_two_places() -> None:
    grid, along = corridor()
    seen = seen_at(grid, doorway_within(0.3, along))
    judge = FloorJudge(FloorModel(()), seen)
    gates = with_lines(judge, grid)
    assert gates.at_cuts.tolist() == [True]
    assert gates.width_m[0] == pytest.approx(1.8, abs=0.06)
    assert gates.depth_m[0] == pytest.approx(0.4)
    assert gates.openings.half_width_m[0] == pytest.approx(0.9, abs=0.06), "as wide as before"
    assert abs(gates.heading_rad[0]) < 0.01
    probability = judge.judged(gates, np.array([0.001]))
    assert probability[0] == pytest.approx(0.95, abs=0.01), "the word of the networks alone"
    places = places_between(gates, probability)
    assert places.count == 2
    assert places.segments.area_m2 == pytest.approx([7.2, 7.2], abs=0.5)


def test_a_model_of_spaces_takes_the_lines_of_its_judge() -> None:
    grid, along = corridor()
    judge = FloorJudge(FloorModel(()), seen_at(grid, doorway_within(0.3, along)))
    model = SpaceModel(random_list(N_SPACE_COLUMNS, 3), random_list(75, 2), doorway=2)
    assert len(model.spaces(grid).gates) == 0
    spaces = model.spaces(grid, judge=judge)
    assert spaces.gates.at_cuts.tolist() == [True]
    assert spaces.places.count == 2
    assert len(spaces.doorways) == 1
    known = np.full(grid.shape, 0, np.int16)
    assert len(model.spaces(grid, judge=judge, known=known).doorways) == 0, "painted otherwise"
    without = replace(model, gates=None)
    assert len(without.spaces(grid, judge=judge).gates) == 0, "who knows no doorways has no judge"


def test_nobody_holds_two_segmentations(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[weakref.ref[Segmentation]] = []
    alive: list[int] = []

    class Counted(Segmentation):
        @classmethod
        def of(cls, *given: Any, **named: Any) -> Segmentation:  # type: ignore[override]
            alive.append(sum(item() is not None for item in made))
            found = Segmentation.of(*given, **named)
            made.append(weakref.ref(found))
            return found

    grid, along = corridor()
    judge = FloorJudge(FloorModel(()), seen_at(grid, doorway_within(0.3, along)))
    model = SpaceModel(random_list(N_SPACE_COLUMNS, 3), random_list(75, 2), doorway=2)
    monkeypatch.setattr(space_model, "Segmentation", Counted)
    model.spaces(grid, judge=judge)
    assert alive == [0, 0]


def test_a_narrow_passage_is_no_news() -> None:
    grid = grid_of(two_rooms())
    gates = candidates(grid)
    doorway = np.full(grid.shape, 0.01)
    doorway[16:27, 39:44] = 0.95
    judge = FloorJudge(FloorModel(()), seen_at(grid, doorway))
    assert len(gates) == 1
    assert len(judge.cuts(gates)) == 0
    assert not gates.at_cuts.any()


@pytest.mark.parametrize(
    ("width_m", "half_m", "likely"),
    [
        pytest.param(1.8, 0.3, 0.89, id="unsure"),
        pytest.param(3.6, 0.3, 0.95, id="too wide"),
        pytest.param(0.3, 0.3, 0.95, id="too narrow"),
        pytest.param(1.8, 0.0, 0.95, id="nothing"),
    ],
)
def test_there_is_no_line(width_m: float, half_m: float, likely: float) -> None:
    grid, along = corridor(width_m)
    lines = door_lines(candidates(grid), seen_at(grid, doorway_within(half_m, along, likely)))
    assert lines.shape == (0, 2)


def test_the_mean_along_a_line_counts_its_first_sample_once() -> None:
    grid, along = corridor()
    doorway = doorway_within(0.3, along, 0.89)
    doorway[50, 50] = 0.95
    assert len(door_lines(candidates(grid), seen_at(grid, doorway))) == 0


def test_specks_are_no_doorways() -> None:
    grid, _ = corridor()
    doorway = np.full((100, 100), 0.01)
    doorway[50, 50:55] = 0.95
    assert len(door_lines(candidates(grid), seen_at(grid, doorway))) == 0
    doorway[51, 50:55] = 0.95
    doorway[41:59, 52] = 0.95
    assert len(door_lines(candidates(grid), seen_at(grid, doorway))) > 0


def test_a_blob_around_a_candidate_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = grid_of(two_rooms())
    doorway = np.full(grid.shape, 0.01)
    doorway[10:33, 36:47] = 0.95
    monkeypatch.delattr(module, "_line")
    assert len(door_lines(candidates(grid), seen_at(grid, doorway))) == 0


def test_a_line_goes_where_networks_are_surest() -> None:
    grid, along = corridor()
    doorway = doorway_within(0.5, along, 0.91)
    doorway[:, 53] = 0.99
    lines = door_lines(candidates(grid), seen_at(grid, doorway))
    inside = lines[grid.free[tuple(lines.T)]]
    assert set(inside[:, 1].tolist()) <= {106, 107}


def test_blobs_are_free_likely_cells_that_touch() -> None:
    rng = np.random.default_rng(5)
    grid = OccupancyGrid(np.where(rng.random((60, 80)) < 0.7, 0, 100).astype(np.int8), 0.1)
    doorway = np.clip(rng.random((60, 80)), 0.01, 0.99)
    seen = seen_at(grid, doorway)
    found = sorted(
        sorted(map(tuple, np.rint(points).astype(int).tolist()))
        for points, _ in module._blobs(grid, seen)
    )
    likely = grid.free & (seen.log_p[..., 2] > np.log(0.5))
    label, n = ndimage.label(likely, CORNERS)
    wanted = [sorted(map(tuple, np.argwhere(label == k).tolist())) for k in range(1, n + 1)]
    assert n > 20
    assert found == sorted(cells for cells in wanted if len(cells) * CELL_M**2 >= 0.06)


def test_maps_with_other_cells_are_divided_at_the_same_place() -> None:
    for resolution_m, n in ((0.025, 200), (0.1, 50), (0.2, 25)):
        cells = np.zeros((n, n), np.int8)
        cells[[0, -1]], cells[:, [0, -1]] = 100, 100
        cells[: round(2.0 / resolution_m)] = 100
        cells[round(3.6 / resolution_m) :] = 100
        grid = OccupancyGrid(cells, resolution_m)
        doorway = np.full((50, 50), 0.01)
        doorway[:, 23:27] = 0.95
        gates = with_lines(FloorJudge(FloorModel(()), seen_at(grid, doorway)), grid)
        assert gates.at_cuts.tolist() == [True], resolution_m
        assert gates.centre_m[0] == pytest.approx([2.5, 2.8], abs=0.11)
        assert gates.width_m[0] == pytest.approx(1.6, abs=1e-6)


def test_a_cut_leaves_relief_and_other_segments_as_they_were() -> None:
    grid = grid_of(two_rooms())
    plain = Segmentation.of(grid)
    column = np.stack([np.arange(43), np.full(43, 12)], axis=1)
    cut = Segmentation.of(grid, cuts=column)
    assert np.array_equal(plain.watershed.relief, cut.watershed.relief)
    assert plain.scales[0].count == 2
    assert [scale.count for scale in cut.scales] == [3, 3, 3]
    old, new = plain.scales[0].raster(), cut.scales[0].raster()
    beyond = np.arange(83) > 41  # with two rooms that are the same, the door is in neither
    right = (old == old[20, 60]) & beyond
    assert right.sum() == 40 * 41
    assert np.array_equal((new == new[20, 60]) & beyond, right)
    assert Segmentation.of(grid, cuts=np.empty((0, 2), np.int64)).scales[0].count == 2
