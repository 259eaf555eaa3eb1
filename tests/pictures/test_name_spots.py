"""Names of places: below their discs if they can, and never on each other where a side is free."""

from itertools import combinations

import numpy as np
import pytest

from pgm_places.pictures.drawing import text_width
from pgm_places.pictures.topology_pictures import name_spots


def overlap(first: np.ndarray, second: np.ndarray, name: str, other: str, size: float) -> bool:
    """Whether two names cover each other."""
    apart = np.abs(first - second)
    wide = (text_width(name, size) + text_width(other, size)) / 2
    return bool(apart[0] < wide and apart[1] < size)


@pytest.mark.parametrize(("doorways", "side"), [([], 1), ([(100, 70)], -1)])
def test_a_name_stands_below_its_disc_unless_a_doorway_does(
    doorways: list[tuple[float, float]], side: int
) -> None:
    [(x, y)] = name_spots(["room 1"], [(100, 50)], doorways, size=14, radius=8)
    assert x == 100
    assert side * (y - 50) > 8 + 7


def test_names_of_neighbours_do_not_cover_each_other() -> None:
    names = ["room 11", "room 12", "room 13"]
    discs = [(100, 50), (130, 50), (160, 50)]
    spots = name_spots(names, discs, [], size=14, radius=8)
    for i, j in combinations(range(3), 2):
        assert not overlap(spots[i], spots[j], names[i], names[j], 14)


def test_no_names() -> None:
    assert name_spots([], [], [(1, 2)], size=14, radius=8).shape == (0, 2)
