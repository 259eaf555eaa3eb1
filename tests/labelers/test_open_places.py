"""Open places between doorways, decided as a whole where they are seen as half and half."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.labelers.open_places import with_open_places_decided
from tests.labelers.test_space_consistency import CORRIDOR, DOORWAY, NAMES, ROOM, layout_of, scores


def decided(
    label: NDArray[np.int64],
    sure: object = 0.7,
    place: NDArray[np.int64] | None = None,
    known: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    number = np.zeros(label.shape, np.int64) if place is None else place
    given = scores(label, sure)
    flat = None if known is None else known.ravel()
    return with_open_places_decided(given, number.ravel(), layout_of(label.shape), NAMES, flat)


def halves(share: float, height: int = 40) -> NDArray[np.int64]:
    """A space of 4 x 10 m; the left part is rather corridor."""
    return np.where(np.arange(100) < 100 * share, CORRIDOR, ROOM) + np.zeros((height, 1), int)


def test_every_cell_of_an_open_place_takes_the_median() -> None:
    label = halves(0.4)
    label[10:12, 50:55] = DOORWAY
    sure = np.where(label == CORRIDOR, 0.9, 0.6)
    found, given = decided(label, sure), scores(label, sure)
    odds = given[:, CORRIDOR] - given[:, ROOM]
    pair = label.ravel() != DOORWAY
    np.testing.assert_allclose(
        (found[:, CORRIDOR] - found[:, ROOM])[pair], np.median(odds[pair]) - 2, rtol=0, atol=1e-9
    )
    assert (found.argmax(axis=1)[pair] == ROOM).all()
    np.testing.assert_allclose(np.exp(found).sum(axis=1), 1, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(found[:, DOORWAY], given[:, DOORWAY])
    np.testing.assert_array_equal(found[~pair], given[~pair])


@pytest.mark.parametrize("label", [halves(0.2), halves(0.5, height=26)], ids=["small", "narrow"])
def test_a_small_part_and_a_narrow_place_keep_their_border(label: NDArray[np.int64]) -> None:
    given = scores(label)
    place, layout = np.zeros(label.size, np.int64), layout_of(label.shape)
    assert with_open_places_decided(given, place, layout, NAMES) is given
    assert with_open_places_decided(given, place, layout, ("lab", "room", "door")) is given


def test_places_are_decided_one_by_one() -> None:
    label = np.vstack([halves(0.4), halves(0.6), halves(1.0)])
    place = np.repeat([0, 1, -1], 40)[:, np.newaxis] + np.zeros((1, 100), int)
    found = decided(label, 0.9, place).argmax(axis=1).reshape(label.shape)
    assert (found[:40] == ROOM).all() and (found[40:] == CORRIDOR).all()


def test_what_is_known_of_a_place_decides_and_contradictions_leave_it_alone() -> None:
    label, known = halves(0.4), np.full((40, 100), -1)
    known[5, 5] = CORRIDOR
    assert (decided(label, known=known).argmax(axis=1) == CORRIDOR).all()
    known[5, 90] = ROOM
    found = decided(label, known=known).argmax(axis=1)
    np.testing.assert_array_equal(found, label.ravel())


@pytest.mark.parametrize(("sure", "wanted"), [(0.6, ROOM), (0.9, CORRIDOR)])
def test_an_open_place_is_a_room_unless_much_speaks_for_a_corridor(
    sure: float, wanted: int
) -> None:
    assert (decided(halves(0.7), sure).argmax(axis=1) == wanted).all()
