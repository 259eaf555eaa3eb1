"""Stable ids of the nodes and edges of a route graph across exports."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np

from pgm_places.errors import InputError
from pgm_places.io.input_file import read_json
from pgm_places.progress import warn
from pgm_places.topology.route_graph import RouteGraph

FIRST_NODE, FIRST_EDGE = 10_001, 30_001
"""Lower ids belong to places. Nav2 holds ids in 16 bits."""

SAME_M = 0.5
"""A node within this distance of an earlier one is the same node."""

_MOST_BYTES = 1 << 28


@dataclass(frozen=True)
class EarlierIds:
    """The ids of an earlier export.

    Parameters
    ----------
    nodes : dict
        Positions (x, y) in metres of the nodes without a place, by id.
    edges : dict
        Id of each directed edge by the ids of its ends.
    """

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    edges: dict[tuple[int, int], int] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None) -> "EarlierIds":
        """The ids in a GeoJSON file of an earlier export; none without a file.

        A damaged or foreign file gives a warning, and all ids are new.
        """
        if path is None or not path.is_file():
            return cls()
        try:
            record = read_json(path, InputError, "a route graph", max_bytes=_MOST_BYTES)
            nodes: dict[int, tuple[float, float]] = {}
            edges: dict[tuple[int, int], int] = {}
            for feature in record["features"]:
                values = feature["properties"]
                if feature["geometry"]["type"] == "Point":
                    if not values["metadata"]["is_anchor"]:
                        x, y = feature["geometry"]["coordinates"]
                        nodes[int(values["id"])] = (float(x), float(y))
                else:
                    edges[int(values["startid"]), int(values["endid"])] = int(values["id"])
        except (InputError, KeyError, TypeError, ValueError) as error:
            warn(f"{path} cannot be read, so all nodes and edges get new ids: {error}")
            return cls()
        return cls(nodes, edges)


def node_ids(routes: RouteGraph, earlier: EarlierIds) -> list[int]:
    """The id of each node: its place's, an earlier node's at its position, or a new one."""
    places = {node.region for node in routes.nodes if node.is_anchor}
    ids: list[int | None] = [node.region if node.is_anchor else None for node in routes.nodes]
    taken = {*places}
    for index, number in _matches(routes, earlier):
        if ids[index] is None and number not in taken:
            ids[index] = number
            taken.add(number)
    new = _unused(FIRST_NODE, {*earlier.nodes, *earlier.edges.values(), *places})
    return [next(new) if number is None else number for number in ids]


def edge_ids(
    ways: Sequence[tuple[int, int]], nodes: Sequence[int], earlier: EarlierIds
) -> list[int]:
    """The id of each directed edge, by the ids of its nodes: the earlier one, or a new one."""
    new = _unused(FIRST_EDGE, {*nodes, *earlier.edges.values(), *earlier.nodes})
    own = {*nodes}
    known = [earlier.edges.get(way) for way in ways]
    return [next(new) if number is None or number in own else number for number in known]


def _matches(routes: RouteGraph, earlier: EarlierIds) -> Iterator[tuple[int, int]]:
    """Pairs of a node's index and an earlier id near it, the nearest pairs first."""
    if not earlier.nodes or not routes.nodes:
        return
    from scipy.spatial import cKDTree

    numbers = list(earlier.nodes)
    trees = [
        cKDTree(np.array(points))
        for points in ([node.point_m for node in routes.nodes], list(earlier.nodes.values()))
    ]
    near = trees[0].sparse_distance_matrix(trees[1], SAME_M, output_type="ndarray")
    for match in near[np.lexsort((near["j"], near["i"], near["v"]))]:
        yield int(match["i"]), numbers[int(match["j"])]


def _unused(first: int, taken: set[int]) -> Iterator[int]:
    """Unused numbers from ``first`` on."""
    return (number for number in count(first) if number not in taken)
