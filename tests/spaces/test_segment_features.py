"""Features of segments and cells against slow and obvious ones, and on turned and finer maps."""

from dataclasses import fields

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pgm_places import LabelGraph, OccupancyGrid, load_map
from pgm_places.errors import InputError
from pgm_places.graph.layout import MaskCells
from pgm_places.spaces import cell_features
from pgm_places.spaces.cell_features import CellFeatures, NodeFeatures, space_feature_names
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.openings import Openings
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segment_features import (
    SegmentRows,
    area_cut_off,
    betweenness,
    neighbour_lists,
    segment_features,
    shape_columns,
)
from pgm_places.spaces.segmentation import Segmentation, SpaceSegments, divided
from pgm_places.spaces.space_spec import SEGMENT_FEATURES
from tests.on_threads import on
from tests.real_data import real_data_folder
from tests.reference import spaces as reference
from tests.refusals import refused
from tests.spaces.floors import TURNS, corridor_with_doors, corridor_with_rooms, grid_of, two_rooms

NAMES = tuple(spec.id for spec in SEGMENT_FEATURES)
maps = arrays(
    np.int8,
    st.tuples(st.integers(8, 24), st.integers(8, 24)),
    elements=st.sampled_from([0, 100, -1]),
    fill=st.just(np.int8(0)),
)


def columns(segments: SpaceSegments) -> dict[str, np.ndarray]:
    return dict(zip(NAMES, segment_features(segments).T, strict=True))


# ------------------------------------------------------------------ against slow ones


@given(cells=maps)
@settings(max_examples=60)
def test_shapes_are_those_of_the_raster(cells: np.ndarray) -> None:
    scale = Segmentation.of(OccupancyGrid(cells, 0.5)).scales[0]
    found, raster = shape_columns(SegmentRows([scale])), scale.raster()
    found["unknown"] = found["unknown"] * found["outline"]
    for k in range(scale.count):
        if scale.watershed.basins.n_lines:
            continue  # cells of lines border on no opening
        wanted = reference.shape(raster, k, cells, 0.5)
        assert scale.area_m2[k] == pytest.approx(wanted["area"])
        for name in ("roundness", "short", "long", "outline", "unknown", "furniture"):
            assert found[name][k] == pytest.approx(wanted[name], rel=1e-9, abs=1e-9), name


@given(cells=maps)
@settings(max_examples=60)
def test_divisions_described_at_once_are_those_described_one_by_one(cells: np.ndarray) -> None:
    scales = Segmentation.of(OccupancyGrid(cells, 0.5), (1.0, 0.8, 0.5)).scales
    one_by_one = [segment_features(scale) for scale in scales]
    np.testing.assert_array_equal(segment_features(*scales), np.concatenate(one_by_one))
    for scale in scales:
        basins = scale.segment_of[None, : scale.watershed.basins.count]
        (alone,) = divided(scale.watershed, basins)
        np.testing.assert_array_equal(alone.segment_of, scale.segment_of)
        for field in fields(Openings):
            found = getattr(scale.openings, field.name)
            np.testing.assert_array_equal(found, getattr(alone.openings, field.name))


@st.composite
def graphs(draw: st.DrawFn) -> tuple[LabelGraph, np.ndarray]:
    n = draw(st.integers(1, 9))
    every = [(a, b) for a in range(n) for b in range(a + 1, n)]
    pairs = draw(st.lists(st.sampled_from(every), unique=True)) if every else []
    area = draw(st.lists(st.integers(1, 9), min_size=n, max_size=n))
    return LabelGraph.from_edges(n, pairs), np.array(area, float)


def neighbours(graph: LabelGraph) -> tuple[np.ndarray, np.ndarray]:
    return neighbour_lists(graph.edges, graph.n_nodes)


def networkx_of(graph: LabelGraph) -> "nx.Graph[int]":
    found: nx.Graph[int] = nx.Graph()
    found.add_nodes_from(range(graph.n_nodes))
    found.add_edges_from(graph.edges.tolist())
    return found


@given(drawn=graphs())
def test_betweenness_is_that_of_networkx(drawn: tuple[LabelGraph, np.ndarray]) -> None:
    graph, area = drawn
    whole = networkx_of(graph)
    wanted: dict[int, float] = {}
    for part in nx.connected_components(whole):
        wanted |= nx.betweenness_centrality(whole.subgraph(part))
    assert betweenness(*neighbours(graph), area) == pytest.approx(
        [wanted[k] for k in range(graph.n_nodes)]
    )


def test_paths_from_some_nodes_are_near_those_from_all() -> None:
    generator = np.random.default_rng(3)
    graph = LabelGraph.from_points(generator.random((120, 2)), n_neighbours=4)
    every = betweenness(*neighbours(graph), np.ones(120))
    some = betweenness(*neighbours(graph), generator.random(120), _most_sources=60)
    assert np.corrcoef(every, some)[0, 1] > 0.95
    assert some.sum() == pytest.approx(every.sum(), rel=0.1)


@given(drawn=graphs())
def test_what_is_cut_off_is_what_hangs_apart(drawn: tuple[LabelGraph, np.ndarray]) -> None:
    graph, area = drawn
    whole, found = networkx_of(graph), area_cut_off(*neighbours(graph), area)
    for part in nx.connected_components(whole):
        for node in part:
            rest = whole.subgraph(part - {node})
            parts = [area[list(p)].sum() for p in nx.connected_components(rest)]
            wanted = 1 - max(parts) / sum(parts) if parts else 0.0
            assert found[node] == pytest.approx(wanted)


@given(
    free=arrays(np.bool_, st.tuples(st.integers(10, 24), st.integers(10, 24)), fill=st.just(True)),
    order=st.sampled_from(["rows", "columns", "any"]),
)
@settings(max_examples=40)
def test_cells_are_looked_up_as_one_by_one(free: np.ndarray, order: str) -> None:
    gates = gate_candidates(Segmentation.of(grid_of(free, 0.5)))
    places = places_between(gates, np.arange(len(gates)) % 2 == 0)
    features = CellFeatures.of(gates.segmentation, places)
    cells = np.argwhere(np.ones_like(free))
    if order == "columns":
        cells = cells[np.lexsort(cells.T)]
    elif order == "any":
        cells = np.random.default_rng(0).permutation(cells)[:200]
    wanted = reference.cell_features(features, cells)
    assert np.array_equal(features.lookup(cells), wanted)


def test_the_nearest_opening_changes_within_a_run_of_cells() -> None:
    """Doors all along a corridor, and cells of each row in any order."""
    features = CellFeatures.of(Segmentation.of(grid_of(corridor_with_doors())))
    cells = np.random.default_rng(2).permutation(np.argwhere(corridor_with_doors()))
    for one in (cells[np.lexsort((cells[:, 1], cells[:, 0]))], cells[np.argsort(cells[:, 0])]):
        rows, wanted = features.lookup(one), reference.cell_features(features, one[::37])
        assert np.array_equal(rows[::37], wanted)
        width = rows[:, features.names.index("way_out_width[0.9]")]
        assert len(np.unique(width[one[:, 0] == 27])) > 2


def test_cells_on_a_line_between_segments_have_no_depth() -> None:
    free = two_rooms(wall=3)
    features = CellFeatures.of(Segmentation.of(grid_of(free)))
    on_line = np.argwhere((features.divisions[0].raster() < 0) & free)
    assert len(on_line) and np.array_equal(
        features.lookup(on_line), reference.cell_features(features, on_line)
    )
    assert (features.lookup(on_line)[:, features.names.index("depth[0.9]")] == 0).all()


def test_the_way_out_is_that_to_points_along_the_openings() -> None:
    free = corridor_with_rooms()
    scale = Segmentation.of(grid_of(free)).scales[0]
    features, o = CellFeatures.of(Segmentation.of(grid_of(free))), scale.openings
    cells = np.argwhere(free)[::97]
    columns = [features.names.index(f"{name}[0.9]") for name in ("way_out", "way_out_width")]
    for cell, (distance, width) in zip(cells, features.lookup(cells, columns), strict=True):
        best = (10.0, 0.0)
        for m in np.flatnonzero((o.segments == scale.at([cell])).any(axis=1)):
            steps = np.linspace(-0.5, 0.5, 201)[:, None] * (o.length_m[m] - 0.1) / 0.1
            line = o.centre_rc[m] + steps * o.direction_rc[m]
            away = 0.1 * np.sqrt(((line - cell) ** 2).sum(axis=1)).min()
            best = min(best, (away, o.half_width_m[m]))
        assert distance == pytest.approx(best[0], abs=0.006)
        assert width == pytest.approx(best[1])


# ------------------------------------------------------------------ a floor that is easily seen


def test_a_corridor_with_three_rooms() -> None:
    scale = Segmentation.of(grid_of(corridor_with_rooms())).scales[0]
    assert scale.count == 4
    found = columns(scale)
    corridor = int(np.argmin(found["aspect"]))
    rooms = np.flatnonzero(np.arange(4) != corridor)
    assert found["area"][corridor] == pytest.approx(26, abs=1)
    assert found["area"][rooms] == pytest.approx([16.8] * 3, abs=1)
    assert found["radius"][[corridor, *rooms]] == pytest.approx([1.0, 2.0, 2.0, 2.0], abs=0.1)
    assert found["long"][corridor] == pytest.approx(13.0, abs=0.1)
    assert found["openings"][[corridor, *rooms]].tolist() == [3, 1, 1, 1]
    assert found["narrow"][[corridor, *rooms]].tolist() == [3, 1, 1, 1]
    assert found["widest"] == pytest.approx([0.45] * 4, abs=0.03)
    assert found["betweenness"][[corridor, *rooms]].tolist() == [1, 0, 0, 0]
    assert found["cut"][corridor] == pytest.approx(2 / 3, abs=0.01)
    assert found["rank"][corridor] == 1.0
    assert found["neighbour_area"][rooms] == pytest.approx([found["area"][corridor]] * 3)
    assert found["largest_aspect"][rooms] == pytest.approx([found["aspect"][corridor]] * 3)
    assert found["open_share"][rooms] == pytest.approx([0.9 / 17.4] * 3, rel=0.1)


def test_cells_take_the_features_of_their_segments() -> None:
    grid = grid_of(corridor_with_rooms())
    found = Segmentation.of(grid)
    features = CellFeatures.of(found)
    assert features.names == space_feature_names(found.ratios)
    cells = np.array([[50, 20], [26, 22], [0, 0]])
    rows = features.lookup(cells)
    table = segment_features(found.scales[0])
    segment = found.scales[0].at(cells)
    own = [features.names.index(f"{name}[0.9]") for name in NAMES]
    assert (rows[:2, own] == table[segment[:2]].astype(np.float32)).all()
    assert (rows[2, own] == 0).all() and rows[2, 0] == 0
    at = {name: features.names.index(f"{name}[0.9]") for name in ("depth", "way_out")}
    assert rows[0, at["depth"]] > 0.8
    assert rows[1, at["way_out"]] < 0.5 and rows[2, at["way_out"]] == 10
    assert features.lookup(np.empty((0, 2), int)).shape == (0, len(features.names))


def test_some_columns_in_any_order_on_any_number_of_threads() -> None:
    grid = grid_of(corridor_with_rooms())
    features = CellFeatures.of(Segmentation.of(grid))
    cells = np.tile(np.argwhere(grid.free), (4, 1))
    assert len(cells) > 2 * cell_features._CELLS_PER_TASK
    every = on(1, features.lookup, cells)
    columns = np.random.default_rng(1).permutation(len(features.names))
    out = features.names.index("way_out[0.9]")
    for chosen in (columns, columns[:7], np.array([out]), np.array([3, 0, 0, 120]), columns[:0]):
        found = on(3, features.lookup, cells, chosen)
        assert found.dtype == np.float32
        assert np.array_equal(found, every[:, chosen])


def test_columns_are_written_beside_others() -> None:
    grid = grid_of(corridor_with_rooms())
    features, cells = CellFeatures.of(Segmentation.of(grid)), MaskCells.of(grid.free)
    room = np.full((len(cells), 6), -7.0, np.float32)
    NodeFeatures.of(features, cells).write(np.arange(len(cells)), np.array([5, 0, 40]), room, 2)
    assert np.array_equal(room[:, 2:5], features.lookup(cells[:], [5, 0, 40]))
    assert (room[:, [0, 1, 5]] == -7).all()


def test_unknown_columns_and_cells_are_refused() -> None:
    features = CellFeatures.of(Segmentation.of(grid_of(corridor_with_rooms())))
    with pytest.raises(InputError, match=r"columns must hold integers from 0 to 120, got 121"):
        features.lookup([[1, 1]], [121])
    with pytest.raises(InputError, match=r"must lie on the map .* got \(80, 3\) at index 1"):
        features.lookup([[79, 3], [80, 3]])
    refused(InputError, r"integers of shape \(n, 2\)", features.lookup, [1, 2, 3])


@pytest.mark.parametrize("shape", [(1, 1), (20, 20)])
def test_maps_without_open_space_have_empty_tables(shape: tuple[int, int]) -> None:
    features = CellFeatures.of(Segmentation.of(grid_of(np.zeros(shape, np.bool_))))
    assert [table.shape for table in features.tables] == [(0, 37)] * 3
    row = features.lookup([[0, 0]])[0]
    assert sorted(set(row.tolist())) == [0, 10]


def test_a_single_room_has_finite_features() -> None:
    table = segment_features(Segmentation.of(grid_of(np.ones((30, 30), np.bool_))).scales[0])
    assert table.shape == (1, 37) and np.isfinite(table).all()


# ------------------------------------------------------------------ turned, mirrored, finer


def in_order(table: np.ndarray) -> np.ndarray:
    return table[np.lexsort(np.round(table, 6).T)]


@pytest.mark.real_data
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("name", ["freiburg052", "floors/school_plans1"])
def test_turned_maps_have_the_same_features(name: str, turn: str) -> None:
    grid = load_map(real_data_folder(name) / "map.yaml").grid
    other = grid.with_cells(np.ascontiguousarray(TURNS[turn](grid.cells)))
    for one, two in zip(Segmentation.of(grid).scales, Segmentation.of(other).scales, strict=True):
        first, second = in_order(segment_features(one)), in_order(segment_features(two))
        assert first == pytest.approx(second, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("finer", [2, 4])
def test_finer_cells_change_little(finer: int) -> None:
    """The floor at 10 cm, and the same one in cells of 5 and 2.5 cm."""
    free = corridor_with_rooms()
    fine = free.repeat(finer, axis=0).repeat(finer, axis=1)
    one = segment_features(Segmentation.of(grid_of(free, 0.1)).scales[0])
    two = segment_features(Segmentation.of(grid_of(fine, 0.1 / finer)).scales[0])
    assert one == pytest.approx(two, rel=0.1, abs=0.05)
