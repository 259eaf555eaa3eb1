"""What is drawn of routes: each place is named once, in red where it cannot be reached."""

from typing import Any

import numpy as np

from pgm_places.palette import ERROR
from pgm_places.pictures.drawing import INK
from pgm_places.pictures.route_picture import _draw_names
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.route_graph import route_graph
from tests.topology.floors import NAMES, floor_grid, floor_labels


class Panel:
    """Keeps the names that it is given, with their colours."""

    def __init__(self) -> None:
        self.names: list[tuple[str, Any]] = []

    def text(self, _x: float, _y: float, text: str, *, colour: Any, **_: Any) -> None:
        self.names.append((text, colour))


def test_places_in_another_part_are_named_once_and_in_red() -> None:
    labels = floor_labels()
    topology = topological_map(floor_grid(labels), labels, NAMES)
    routes = route_graph(topology, robot_radius_m=0.3)
    away = next(node.region for node in routes.nodes if topology.place(node.region).label == "room")
    parted: Any = type(routes)(routes.nodes, routes.edges, 0.3, (away,))
    panel: Any = Panel()
    at = np.array([node.point_m for node in routes.nodes])
    _draw_names(panel, topology, parted, at, np.atleast_2d)
    assert [colour for name, colour in panel.names if name == topology.place(away).name] == [ERROR]
    others = [name for name, colour in panel.names if colour == INK]
    assert len(others) == len(set(others)) > 0
