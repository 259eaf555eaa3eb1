"""The topological map as a graph of Nav2's Route Server (GeoJSON)."""

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_text
from pgm_places.io.places.region_features import DIGITS, LOCAL_METRES
from pgm_places.topology.passage_paths import PassagePath, passage_paths
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["nav2_route", "write_nav2_route"]


def nav2_route(
    topology: TopologicalMap, *, frame: str = "map", robot_radius_m: float = 0.0
) -> dict[str, Any]:
    """A FeatureCollection of nodes (Points) and directed edges (MultiLineStrings).

    Nodes are the regions' anchors, with the regions' ids, the midpoints of the passages, and as
    many points in between as keep every edge, a straight line, inside the regions. Edges come in
    both directions, each with an id of its own. Ids are unique over nodes and edges. Metadata hold
    the ``class`` that Nav2's ``SemanticScorer`` looks for and the ``name`` of the place, and no
    null, which the loader refuses. ``abs_speed_limit`` and operations are left to the user.

    Parameters
    ----------
    topology : TopologicalMap
    frame : str
        Name of the map's frame.
    robot_radius_m : float
        Connections that a disc of this radius does not pass are left out.

    Raises
    ------
    InputError
        There is no connection: the Route Server refuses a graph without edges.
    """
    found = [path for path in passage_paths(topology) if path.width_m >= 2 * robot_radius_m]
    if not found:
        raise InputError(
            "no two regions are connected by a passage wide enough; Nav2's Route Server needs at "
            "least one edge"
        )
    builder = _Builder(topology, frame)
    for path in found:
        builder.add(path)
    return {
        "type": "FeatureCollection",
        "name": "graph",
        "crs": LOCAL_METRES,
        "features": [*builder.nodes, *builder.edges],
    }


class _Builder:
    """Features with unique ids."""

    def __init__(self, topology: TopologicalMap, frame: str) -> None:
        self.topology, self.frame = topology, frame
        self.nodes: list[dict[str, Any]] = []
        self.edges: list[dict[str, Any]] = []
        self.passages: dict[tuple[float, float], int] = {}
        self.position: dict[int, tuple[float, float]] = {}
        for region in topology.regions:
            self.node(region.id, region.anchor_m, region.id)
        self.free = max((region.id for region in topology.regions), default=0) + 1

    def next_id(self) -> int:
        self.free += 1
        return self.free - 1

    def node(self, number: int, point: tuple[float, float], region_id: int) -> None:
        region = self.topology.place(region_id)
        self.position[number] = point
        self.nodes.append(
            {
                "type": "Feature",
                "properties": {
                    "id": number,
                    "frame": self.frame,
                    "metadata": {
                        "class": region.label,
                        "name": region.name,
                        "region": region.id,
                        "is_anchor": number == region.id,
                    },
                },
                "geometry": {"type": "Point", "coordinates": _rounded(point)},
            }
        )

    def add(self, path: PassagePath) -> None:
        """The nodes and edges from an anchor to the middle of a passage and back."""
        last = path.points_m[-1]
        if last not in self.passages:
            self.passages[last] = self.next_id()
            self.node(self.passages[last], last, path.region)
        middle = [self.next_id() for _ in path.points_m[1:-1]]
        for number, point in zip(middle, path.points_m[1:-1], strict=True):
            self.node(number, point, path.region)
        chain = [path.region, *middle, self.passages[last]]
        for a, b in itertools.pairwise(chain):
            self.edge(a, b, path)
            self.edge(b, a, path)

    def edge(self, start: int, end: int, path: PassagePath) -> None:
        ends = (self.position[start], self.position[end])
        length = float(np.hypot(*np.subtract(*ends)))
        region = self.topology.place(path.region)
        self.edges.append(
            {
                "type": "Feature",
                "properties": {
                    "id": self.next_id(),
                    "startid": start,
                    "endid": end,
                    "cost": round(length, DIGITS),
                    "overridable": True,
                    "metadata": {
                        "class": region.label,
                        "name": region.name,
                        "width_m": round(path.width_m, DIGITS),
                    },
                },
                "geometry": {
                    "type": "MultiLineString",
                    "coordinates": [[_rounded(point) for point in ends]],
                },
            }
        )


def _rounded(point: tuple[float, float]) -> list[float]:
    return [round(value, DIGITS) for value in point]


def write_nav2_route(path: Path | str, topology: TopologicalMap, **options: Any) -> Path:
    """Write the graph for Nav2's Route Server; the path. Options are those of ``nav2_route``."""
    graph = nav2_route(topology, **options)
    return write_text(path, json.dumps(graph, allow_nan=False) + "\n")
