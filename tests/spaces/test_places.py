"""Places between accepted gates."""

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.spaces.gates import Gates, gate_candidates
from pgm_places.spaces.places import place_features, places_between
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import PLACE_FEATURES
from tests.refusals import refused
from tests.spaces.floors import corridor_with_rooms, grid_of, two_rooms

NAMES = [spec.id for spec in PLACE_FEATURES]


@pytest.fixture(scope="module")
def gates() -> Gates:
    return gate_candidates(Segmentation.of(grid_of(corridor_with_rooms())))


@pytest.mark.parametrize("accepted", [[k >> b & 1 == 1 for b in range(3)] for k in range(8)])
def test_every_accepted_gate_parts_a_room(gates: Gates, accepted: list[bool]) -> None:
    found = places_between(gates, accepted)
    assert found.count == 1 + sum(accepted)
    assert found.parting.tolist() == accepted
    # a room is where its gate says: the cell in its middle, and the corridor's
    cells = [[10, 67], [50, 23], [50, 67], [50, 111]]
    corridor, *rooms = found.segments.at(cells).tolist()
    assert [room != corridor for room in rooms] == accepted
    assert found.segments.area_m2.sum() == pytest.approx(gates.segmentation.scales[0].area_m2.sum())


def test_with_all_gates_places_are_the_segments_here(gates: Gates) -> None:
    found = places_between(gates, np.ones(3, np.bool_))
    finest = gates.segmentation.scales[0]
    assert (found.segments.raster() == finest.raster()).all()
    assert place_features(found)[:, :37] == pytest.approx(segment_features(finest))
    assert found.graph.edges.tolist() == finest.graph.edges.tolist()


def test_probabilities_are_compared_with_the_threshold(gates: Gates) -> None:
    p = np.array([0.2, 0.5, 0.9])
    assert places_between(gates, p).accepted.tolist() == [False, False, True]
    assert places_between(gates, p, threshold=0.1).accepted.tolist() == [True] * 3


def test_gates_and_neighbours_are_counted(gates: Gates) -> None:
    found = places_between(gates, [True, True, False])
    table = dict(zip(NAMES, place_features(found).T, strict=True))
    corridor, one, two = found.segments.at([[10, 67], [50, 23], [50, 67]]).tolist()
    order = [corridor, one, two]
    assert table["gates"][order].tolist() == [2, 1, 1]
    assert table["one_gate"][order].tolist() == [2, 0, 0]
    assert table["one_gate_share"][order].tolist() == [1, 0, 0]
    assert table["gate_density"] == pytest.approx(table["gates"] / np.sqrt(table["area"]))
    assert table["gates_along"] == pytest.approx(table["gates"] / table["long"])
    assert table["one_gate_density"] == pytest.approx(table["one_gate"] / np.sqrt(table["area"]))


def test_a_wide_opening_joins_in_spite_of_a_door() -> None:
    """Two halls of 12 m with a door and a gap of 5 m between them are one place."""
    free = np.zeros((124, 250), np.bool_)
    free[2:122, 2:122] = free[2:122, 128:248] = True
    free[10:19, 122:128] = True
    door_only = gate_candidates(Segmentation.of(grid_of(free)))
    assert len(door_only) == 1
    assert places_between(door_only, [True]).count == 2
    free[60:110, 122:128] = True
    both = gate_candidates(Segmentation.of(grid_of(free)))
    assert len(both) == 1 and len(both.segmentation.scales[0].openings) == 2
    found = places_between(both, [True])
    assert found.count == 1 and not found.parting.any()
    assert place_features(found)[0, NAMES.index("gates")] == 0


def cracked_wall(right: int) -> np.ndarray:
    """Two rooms of 4 m, the second ``right`` cells wide, and a crack of 10 cm in their wall."""
    free = two_rooms(wall=2, right=right, door=1)
    free[21, 41:43] = True
    return free


def test_a_crack_in_a_wall_joins_nothing() -> None:
    gates = gate_candidates(Segmentation.of(grid_of(cracked_wall(40))))
    assert len(gates) == 0 and len(gates.segmentation.scales[0].openings) == 1
    assert places_between(gates, []).count == 2


def test_a_corner_behind_a_crack_is_no_place() -> None:
    gates = gate_candidates(Segmentation.of(grid_of(cracked_wall(4))))
    assert len(gates) == 0 and gates.segmentation.scales[0].count == 2
    assert places_between(gates, []).count == 1


@pytest.mark.parametrize(
    ("accepted", "threshold", "message"),
    [
        ([True], 0.5, "one boolean or probability per gate"),
        ([1, 0, 1], 0.5, "one boolean or probability per gate"),
        ([0.5, 1.5, 0.0], 0.5, "probabilities from 0 to 1"),
        ([0.5, np.nan, 0.0], 0.5, "probabilities from 0 to 1"),
        ([0.5] * 3, 0.0, "threshold must lie between 0 and 1"),
        ([0.5] * 3, 1.0, "threshold must lie between 0 and 1"),
        ([0.5] * 3, np.nan, "threshold must lie between 0 and 1"),
    ],
)
def test_wrong_acceptance_is_refused(
    gates: Gates, accepted: list[float], threshold: float, message: str
) -> None:
    refused(InputError, message, places_between, gates, accepted, threshold=threshold)


def test_maps_without_gates_have_places_too() -> None:
    empty = gate_candidates(Segmentation.of(grid_of(np.zeros((9, 9), np.bool_))))
    assert places_between(empty, []).count == 0
    assert place_features(places_between(empty, [])).shape == (0, 43)
    room = gate_candidates(Segmentation.of(grid_of(two_rooms()[:, :42])))
    assert place_features(places_between(room, [])).shape == (1, 43)


def ring() -> Gates:
    """A room with a door to each half of a corridor that is narrow in its middle."""
    free = np.zeros((70, 100), np.bool_)
    free[2:40, 10:90] = True
    free[46:68, 2:98] = True
    free[46:68, 49:51] = False
    free[52:62, 49:51] = True  # 1 m between the halves
    free[40:46, 20:29] = free[40:46, 70:79] = True
    return gate_candidates(Segmentation.of(grid_of(free)))


@pytest.mark.parametrize(
    ("doors", "middle", "accepted"),
    [
        ((0.9, 0.9), 0.01, [True, True, False]),
        ((0.9, 0.4), 0.01, [True, True, False]),  # the doubtful door is cut with the sure one
        ((0.9, 0.02), 0.01, [False, False, False]),  # two openings say that it is one place
        ((0.6, 0.3), 0.01, [False, False, False]),
        ((0.9, 0.4), 0.0, [True, True, False]),
        ((0.9, 0.0), 0.0, [False, False, False]),  # what is certain is not weighed
        ((1.0, 0.0), 0.0, [True, False, False]),  # a certain doorway, though it parts nothing
    ],
)
def test_all_gates_between_two_places_are_cut_together(
    doors: tuple[float, float], middle: float, accepted: list[bool]
) -> None:
    gates = ring()
    left, across, right = np.argsort(gates.centre_m[:, 0]).tolist()
    probability = np.empty(3)
    probability[[left, right, across]] = *doors, middle
    found = places_between(gates, probability)
    assert found.accepted[[left, right, across]].tolist() == accepted
    assert found.count == 1 + found.parting.any()
