"""Plans and surveys take arrays of any layout in memory."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pgm_places.simulation.floor_plan import Rect
from pgm_places.simulation.plan_reading import read_plan
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.routes import draw_routes
from pgm_places.simulation.simulated_mapping import N_RAYS, Tour, mapped
from tests.layouts import CHANGES, Array, check_any_layout

SOLID = np.ones((22, 42), np.bool_)
SOLID[1:-1, 1:-1] = False
SOLID[9:13, 6:10] = True
LABELS = np.where(SOLID, -1, 2).astype(np.int16)
LABELS[1:-1, 1:20] = 0
STATIONS = np.array([[3, 4], [30, 12]])
RAYS = np.zeros(len(STATIONS) * N_RAYS, np.int64)
SCALE = MetreScale(100)
ROOMS, PASSAGES = [[Rect(20, 1, 41, 21)]], [[Rect(1, 1, 20, 21)]]


FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Array, ...]]] = {
    "plan": (
        lambda labels, solid: read_plan(SCALE, labels, solid, passages=[0], doorways=[1]),
        (LABELS, SOLID),
    ),
    "drives": (
        lambda solid: draw_routes(
            Dice(3, 0, SCALE), solid, ROOMS, PASSAGES, n_routes=1, coverage=1.0
        ),
        (SOLID,),
    ),
    "survey": (
        lambda stations, offsets, solid: mapped(
            Tour(stations, offsets, RAYS, RAYS), solid, solid, reach=50
        ),
        (STATIONS, np.ones((2, 2), np.int64), SOLID),
    ),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_any_layout_gives_the_same(name: str, change: Callable[[Array], Array]) -> None:
    check_any_layout(*FUNCTIONS[name], change)
