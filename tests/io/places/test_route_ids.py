"""Ids of route graphs from export to export."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pgm_places.io.places.exports import export
from pgm_places.io.places.nav2_route import EarlierIds, node_ids, write_nav2_route
from pgm_places.topology.route_graph import RouteGraph, RouteNode, route_graph
from tests.topology.floors import floor_map


def written(path: Path) -> tuple[dict[int, Any], dict[tuple[int, int], int]]:
    """Positions by id of node, and ids of edges by those of their ends."""
    nodes, edges = {}, {}
    for feature in json.loads(path.read_text())["features"]:
        values = feature["properties"]
        if feature["geometry"]["type"] == "Point":
            nodes[values["id"]] = tuple(feature["geometry"]["coordinates"])
        else:
            edges[values["startid"], values["endid"]] = values["id"]
    assert len({*nodes, *edges.values()}) == len(nodes) + len(edges)
    return nodes, edges


def moved(routes: RouteGraph, by_m: float) -> RouteGraph:
    def aside(node: RouteNode) -> RouteNode:
        x, y = node.point_m
        return replace(node, point_m=(x + by_m, y))

    return replace(routes, nodes=tuple(map(aside, routes.nodes)))


def test_nodes_and_edges_keep_their_ids_though_the_graph_changes(tmp_path: Path) -> None:
    topology = floor_map()
    routes = route_graph(topology)
    path = write_nav2_route(tmp_path / "a.geojson", topology, routes)
    nodes, edges = written(path)
    # The first node that stands for no place, and its edges, are gone; all others move a little.
    gone = next(k for k, node in enumerate(routes.nodes) if not node.is_anchor)
    left = [k for k in range(len(routes.nodes)) if k != gone]
    kept = tuple(
        replace(edge, first=left.index(edge.first), second=left.index(edge.second))
        for edge in routes.edges
        if gone not in (edge.first, edge.second)
    )
    fewer = moved(replace(routes, nodes=tuple(routes.nodes[k] for k in left), edges=kept), 0.1)
    again, joined = written(write_nav2_route(tmp_path / "b.geojson", topology, fewer, earlier=path))
    assert len(again) == len(nodes) - 1 and again.keys() < nodes.keys()
    for number, (x, y) in again.items():
        assert (x, y) == pytest.approx((nodes[number][0] + 0.1, nodes[number][1]))
    assert all(edges[way] == number for way, number in joined.items())
    # What is new gets an id that was never used.
    path = write_nav2_route(tmp_path / "c.geojson", topology, moved(routes, 5.0), earlier=path)
    others, _ = written(path)
    new = {number for number in others if number > 10_000}
    assert new and not new & {*nodes}


def test_exports_into_the_same_folder_keep_ids(tmp_path: Path) -> None:
    [path] = export(floor_map(), "nav2-route", tmp_path)
    before = path.read_bytes()
    export(floor_map(), "nav2-route", tmp_path)
    assert path.read_bytes() == before
    assert min(number for number in written(path)[0] if number > 1000) == 10_001


def test_of_several_nodes_near_an_earlier_one_the_nearest_keeps_its_id() -> None:
    nodes = tuple(RouteNode((x, 0.0), 1, is_anchor=False, clearance_m=1.0) for x in (0.3, 0.1))
    earlier = EarlierIds({10_007: (0.0, 0.0)})
    assert node_ids(RouteGraph(nodes, (), 0.2, ()), earlier) == [10_001, 10_007]


@pytest.mark.parametrize("text", ["{", '{"features": [{"geometry": {}}]}', '{"features": 3}'])
def test_a_graph_that_cannot_be_read_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    path = tmp_path / "nav2_route.geojson"
    path.write_text(text)
    said: list[str] = []
    monkeypatch.setattr("pgm_places.io.places.nav2_route.warn", said.append)
    assert EarlierIds.read(path) == EarlierIds()
    [line] = said
    assert "cannot be read, so all nodes and edges get new ids" in line
    assert EarlierIds.read(tmp_path / "none.geojson") == EarlierIds()
