import hashlib

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.tiling import building_tiled
from pgm_places.errors import InputError
from pgm_places.simulation import LABEL_NAMES, LabelledBuilding, generate_building
from pgm_places.simulation.building import fair_split
from pgm_places.simulation.portable_random import Dice
from pgm_places.simulation.style import draw_style


@pytest.fixture(scope="module")
def floor() -> LabelledBuilding:
    return generate_building(0, resolution_m=0.1)


@pytest.fixture(scope="module", params=range(8))
def small(request: pytest.FixtureRequest) -> LabelledBuilding:
    return generate_building(request.param, size="small")


def digest(*arrays: NDArray[np.generic]) -> str:
    state = hashlib.sha256()
    for array in arrays:
        state.update(repr((array.shape, array.dtype.str)).encode())
        state.update(np.ascontiguousarray(array).tobytes())
    return state.hexdigest()[:16]


def test_a_seed_gives_these_very_cells_on_every_platform() -> None:
    building = generate_building(7, size="small")
    cells, labels = building.grid.cells, building.labels.astype("<i2")
    assert digest(cells, labels) == "186d1ee49a9ab713"


def test_the_default_building_is_these_very_cells() -> None:
    building = generate_building()
    cells, labels = building.grid.cells, building.labels.astype("<i2")
    assert building.grid.shape == (482, 1187)
    assert digest(cells, labels) == "2095bb3df31c0d12"


def test_the_same_seed_gives_the_same_building_and_another_seed_another() -> None:
    first, again, other = (generate_building(seed, size="small") for seed in (1, 1, 2))
    assert digest(first.grid.cells, first.labels) == digest(again.grid.cells, again.labels)
    assert digest(first.grid.cells) != digest(other.grid.cells)


def test_only_free_cells_have_labels(small: LabelledBuilding) -> None:
    assert small.labels.shape == small.grid.shape
    assert small.grid.free[small.labels >= 0].all()
    assert small.labels.dtype == np.int16
    assert not small.labels.flags.writeable


def test_nearly_every_free_cell_has_a_label(floor: LabelledBuilding) -> None:
    free = floor.grid.free
    assert (floor.labels[free] >= 0).mean() > 0.95


def test_both_halves_hold_every_label(small: LabelledBuilding) -> None:
    halves = small.labels[:, : small.split_column], small.labels[:, small.split_column :]
    for half in halves:
        assert np.bincount(half[half >= 0], minlength=len(LABEL_NAMES)).min() > 20


def test_labels_that_no_cell_has_do_not_hinder_the_split() -> None:
    """A survey may see no room, and a small home may have no corridor."""
    labels = np.full((4, 40), -1, np.int16)
    assert fair_split(labels) == 20
    labels[1, 2:12] = 0
    assert fair_split(labels) == 11
    labels[2, 6:30] = 2
    assert fair_split(labels) == 11


def test_labelled_space_is_one_piece(small: LabelledBuilding) -> None:
    pieces, n_pieces = ndimage.label(small.labels >= 0)
    sizes = np.sort(np.bincount(pieces.ravel())[1:])[::-1]
    # Ignored cells, such as gaps in a wall that the survey saw through, may cut a few cells off.
    assert n_pieces >= 1
    assert sizes[0] >= 0.97 * sizes.sum()


def test_all_that_is_labelled_hangs_together_through_free_cells(small: LabelledBuilding) -> None:
    pieces, _ = ndimage.label(small.grid.free)
    assert len(np.unique(pieces[small.labels >= 0])) == 1


def test_doorways_separate_corridors_from_rooms(small: LabelledBuilding) -> None:
    """A way from the corridor into a room that avoids all doorways would be a labelling error."""
    corridor, room, _ = (small.labels == label for label in range(3))
    assert not (ndimage.binary_dilation(corridor) & room).any()


def test_labels_have_the_shares_of_real_floors(floor: LabelledBuilding) -> None:
    shares = np.bincount(floor.labels[floor.labels >= 0]) / (floor.labels >= 0).sum()
    corridor, room, doorway = shares
    assert 0.08 < corridor < 0.4
    assert 0.5 < room < 0.9
    assert 0.01 < doorway < 0.08


def test_a_clean_survey_of_an_empty_building_has_no_free_cells_outside() -> None:
    clean = generate_building(4, size="small", furniture=False, slam_noise=False)
    assert (clean.labels[clean.grid.free] >= 0).all()


def test_furniture_and_noise_leave_the_layout_alone() -> None:
    full = generate_building(5, size="small", slam_noise=False)
    empty = generate_building(5, size="small", slam_noise=False, furniture=False)
    both = (full.labels >= 0) & (empty.labels >= 0)
    assert full.grid.shape == empty.grid.shape
    assert np.array_equal(full.labels[both], empty.labels[both])
    assert full.grid.free.sum() < empty.grid.free.sum()


@pytest.mark.parametrize("seed", range(20, 24))
def test_a_varied_building_keeps_the_rules_of_an_office(seed: int) -> None:
    building = generate_building(seed, style="varied", resolution_m=0.2, slam_noise=False)
    corridor, room, doorway = (building.labels == label for label in range(3))
    assert min(corridor.sum(), room.sum(), doorway.sum()) > 20
    assert not (ndimage.binary_dilation(corridor) & room).any()
    pieces, _ = ndimage.label(building.grid.free)
    assert len(np.unique(pieces[building.labels >= 0])) == 1


def test_varied_buildings_differ_in_the_width_of_their_corridors() -> None:
    styles = [draw_style(Dice(seed, 5)) for seed in range(30)]
    assert min(style.corridor_cm[0] for style in styles) == 120
    assert max(style.corridor_cm[1] for style in styles) == 380
    assert len({(style.corridor_cm, style.door_cm) for style in styles}) > 10


@pytest.mark.parametrize("wings", [1, 3])
def test_any_number_of_wings(wings: int) -> None:
    building = generate_building(2, size="small", wings=wings)
    for half in (
        building.labels[:, : building.split_column],
        building.labels[:, building.split_column :],
    ):
        assert {0, 1, 2} <= set(np.unique(half).tolist())


@pytest.mark.parametrize(
    ("resolution_m", "metres_high"), [(0.2, 11.0), (0.1, 11.0), (0.05, 11.0), (0.04, 11.0)]
)
def test_lengths_do_not_depend_on_the_resolution(resolution_m: float, metres_high: float) -> None:
    building = generate_building(3, size="small", resolution_m=resolution_m)
    assert building.grid.resolution_m == resolution_m
    high = building.grid.shape[0] * resolution_m
    assert high == pytest.approx(metres_high, abs=1.5)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"seed": -1}, "seed must not be negative, got -1"),
        ({"wings": 0}, "wings must be at least 1, got 0"),
        ({"size": "big"}, "size must be 'floor' or 'small', got 'big'"),
        ({"style": "baroque"}, "style must be 'office', 'varied', 'cells', "),
        ({"style": "varied", "size": "small"}, "style 'varied' needs size 'floor'"),
        ({"style": "school", "size": "small"}, "style 'school' needs size 'floor'"),
        ({"halls": "lobby"}, "halls must be 'corridor', 'room' or 'hall', got 'lobby'"),
        ({"resolution_m": 0.5}, "resolution_m must be 0.02 to 0.2 m, got 0.5"),
        ({"resolution_m": float("nan")}, "resolution_m must be a finite number or None, got nan"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text.replace(".", r"\.")):
        generate_building(**arguments)  # type: ignore[arg-type]


def test_a_tiled_map_repeats_its_floors_and_keeps_them_apart() -> None:
    huge = building_tiled(700, resolution_m=0.2, floors=2)
    floors = [generate_building(seed, resolution_m=0.2) for seed in (0, 1)]
    height, width = floors[0].grid.shape
    assert huge.grid.shape == (700, 700)
    assert np.array_equal(huge.grid.cells[:height, :width], floors[0].grid.cells)
    assert np.array_equal(huge.labels[:height, :width], floors[0].labels)
    beside = huge.grid.cells[: floors[1].grid.shape[0], width:]
    shown = min(beside.shape[1], floors[1].grid.shape[1])
    assert np.array_equal(beside[:, :shown], floors[1].grid.cells[:, :shown])
    assert huge.grid.cells.dtype == np.int8
    assert (huge.grid.cells[:, 0] == -1).all()


def test_a_tiled_map_needs_a_size() -> None:
    with pytest.raises(InputError, match="at least 1, got 0 and 3"):
        building_tiled(0)
