"""Functions on places take arrays of any layout in memory."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pgm_places.topology.driving_graph import skeleton_of
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.outlines import outlines
from pgm_places.topology.regions import deepest_cells
from pgm_places.topology.route_graph import route_graph
from tests.layouts import CHANGES, Array, check_any_layout
from tests.topology.floors import floor_grid

PIECE = np.zeros((20, 40), np.int32)
PIECE[:, 20:] = 1
PIECE[8:12, 5:9] = -1
LABELS = np.where(PIECE == 1, 2, 0).astype(np.int16)
LABELS[PIECE < 0] = -1
INSIDE = np.pad(PIECE >= 0, 1)


def routes(labels: Array) -> Any:
    topology = topological_map(floor_grid(labels, resolution_m=0.1), labels, ("a", "b", "c"))
    found = route_graph(topology)
    return [node.point_m for node in found.nodes]


FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Array, ...]]] = {
    "outlines": (lambda piece: [o.polygons for o in outlines(piece, 2)], (PIECE,)),
    "deepest": (lambda piece: deepest_cells(piece, 2), (PIECE,)),
    "skeleton": (skeleton_of, (INSIDE, INSIDE.astype(np.int32), np.array([[2, 2], [18, 35]]))),
    "routes": (routes, (LABELS,)),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_any_layout_gives_the_same(name: str, change: Callable[[Array], Array]) -> None:
    check_any_layout(*FUNCTIONS[name], change)
