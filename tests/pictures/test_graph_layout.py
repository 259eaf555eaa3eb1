"""Drawings of graphs: every node has its dot, wherever it is."""

import networkx as nx
import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.pictures.canvas import GraphLayout

GRAPHS = {
    "positions": LabelGraph.from_points(np.random.default_rng(0).random((50, 2)), n_neighbours=3),
    "chain": LabelGraph.from_lattice((30,)),
    "springs": LabelGraph.from_networkx(nx.karate_club_graph()),
    "many": LabelGraph.from_edges(4000, [(0, 1)]),
    "one": LabelGraph.from_edges(1, []),
    "one spot": LabelGraph.from_edges(3, [(0, 1)], positions_m=np.ones((3, 2))),
}


@pytest.mark.parametrize("name", GRAPHS)
def test_every_dot_shows_a_node_and_every_centre_its_own(name: str) -> None:
    layout = GraphLayout(GRAPHS[name])
    n = layout.graph.n_nodes
    shown = layout.node_of_cell
    rows, columns = layout.cells_rc.T
    apart = len(np.unique(layout.cells_rc, axis=0)) == n
    assert apart or name in ("one spot", "many")
    if apart:
        np.testing.assert_array_equal(shown[rows, columns], np.arange(n))
        np.testing.assert_array_equal(layout.from_raster(shown), np.arange(n))
    np.testing.assert_array_equal(layout.grid.free, shown >= 0)
    painted = layout.to_raster(np.arange(n) % 3, fill=-1)
    np.testing.assert_array_equal(painted[shown >= 0], shown[shown >= 0] % 3)
    assert (painted[shown < 0] == -1).all()


def test_the_same_graph_gives_the_same_drawing() -> None:
    graph = GRAPHS["springs"]
    first, second = GraphLayout(graph), GraphLayout(graph)
    np.testing.assert_array_equal(first.grid.cells, second.grid.cells)
    with pytest.raises(InputError, match=r"one row per node \(34\), got 3"):
        first.to_raster([1, 2, 3], fill=0)
    with pytest.raises(InputError, match="the raster must have shape"):
        first.from_raster([[1]])
