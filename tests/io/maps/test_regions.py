"""Regions in map metres: exact rasters, overlaps, class mappings, refusals."""

import json
import logging
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import OccupancyGrid
from pgm_places.errors import LabelError
from pgm_places.io.maps.regions import load_regions, rasterize_polygon, read_regions
from tests.reference.polygons import distance_to_edges, inside_even_odd

NAMES = ["corridor", "room"]


def grid(height: int = 6, width: int = 8, **frame: Any) -> OccupancyGrid:
    return OccupancyGrid(np.zeros((height, width), np.int8), **{"resolution_m": 1.0, **frame})


def box(x0: float, y0: float, x1: float, y1: float) -> list[list[float]]:
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]


def feature(rings: Any, code: Any = "room", kind: str = "Polygon") -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {"class": code},
        "geometry": {"type": kind, "coordinates": rings},
    }


def write(folder: Path, *features: Any) -> Path:
    path = folder / "regions.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def test_holes_and_several_polygons(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        feature(
            [[box(0, 0, 5, 5), box(1, 1, 4, 4)], [box(2, 2, 3, 3)]], "corridor", "MultiPolygon"
        ),
    )
    labels = load_regions(path, NAMES, grid())
    expected = np.full((6, 8), -1)
    expected[:5, :5] = 0
    expected[1:4, 1:4] = -1
    expected[2, 2] = 0
    assert (labels == expected).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_smaller_region_wins_and_of_equal_ones_the_later(
    tmp_path: Path, order: tuple[int, int]
) -> None:
    features = [feature([box(0, 0, 4, 4)], "corridor"), feature([box(1, 1, 3, 3)], "room")]
    labels = load_regions(write(tmp_path, *(features[i] for i in order)), NAMES, grid())
    assert labels[1, 1] == 1 and labels.dtype == np.int16
    assert [(labels == label).sum() for label in (1, 0, -1)] == [4, 12, 32]
    codes = [feature([box(0, 0, 2, 2)], code) for code in ("corridor", "room")]
    path = write(tmp_path, *(codes[i] for i in order))
    assert load_regions(path, NAMES, grid())[0, 0] == order[1]


def test_classes_are_translated_and_the_rest_hides_what_lies_beneath(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write(
        tmp_path,
        feature([box(0, 0, 8, 6)], "CR"),
        feature([box(0, 0, 2, 2)], "ST"),
        feature([box(4, 4, 5, 5)], 7),
        feature([box(6, 0, 7, 1)], "EV"),
    )
    with caplog.at_level(logging.INFO):
        labels = load_regions(
            path, NAMES, grid(), classes={"CR": "corridor", "7": "room", "EV": "", "XX": "room"}
        )
    assert labels[0, 0] == labels[0, 6] == -1
    assert labels[4, 4] == 1
    assert labels[5, 7] == 0
    assert "classes without a label: EV, ST" in caplog.text


def test_a_single_feature_will_do(tmp_path: Path) -> None:
    item = feature([box(0, 0, 2, 2)]) | {"properties": {"class": "room"}}
    path = tmp_path / "one.geojson"
    path.write_text("\ufeff" + json.dumps(item), encoding="utf-8")
    assert load_regions(path, NAMES, grid())[0, 0] == 1


coordinates = st.floats(-2, 9)
polygons = st.lists(
    st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=6), min_size=1, max_size=3
)


@given(
    rings=polygons,
    pose=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-np.pi, np.pi)),
    turned=st.booleans(),
)
def test_the_raster_is_that_of_the_reference(
    rings: list[list[tuple[float, float]]], pose: tuple[float, float, float], turned: bool
) -> None:
    frame: dict[str, Any] = {"origin_xy_m": pose[:2], "yaw_rad": pose[2]} if turned else {}
    there = grid(**frame)
    closed = [np.array([*ring, ring[0]]) for ring in rings]
    rows, columns, inside = rasterize_polygon(closed, there)
    mask = np.zeros(there.shape, np.bool_)
    mask[rows, columns] = inside
    for row, column in np.ndindex(there.shape):
        x, y = there.cell_centres_m([[row, column]])[0]
        if distance_to_edges(x, y, closed) > 1e-9:
            assert mask[row, column] == inside_even_odd(x, y, closed)


@given(
    apex=st.tuples(st.floats(0.0, 8.0), st.floats(0.0, 6.0)),
    snap=st.booleans(),
    yaw=st.sampled_from([0.0, 0.3, np.pi / 2]),
)
def test_polygons_that_share_edges_share_no_cell_and_leave_none(
    apex: tuple[float, float], snap: bool, yaw: float
) -> None:
    if snap:  # corners and edges through the centres of cells
        apex = (np.floor(apex[0]) + 0.5, np.floor(apex[1]) + 0.5)
    there = grid(yaw_rad=yaw)
    corners = np.array(box(-20, -20, 20, 20))
    count = np.zeros(there.shape, np.int64)
    for start, end in pairwise(corners):
        triangle = np.array([start, end, apex, start])
        rows, columns, inside = rasterize_polygon([triangle], there)
        count[rows, columns] += inside
    assert (count == 1).all()


@pytest.mark.parametrize(
    ("item", "message"),
    [
        ({"type": "Feature", "properties": {}, "geometry": None}, "has no geometry; remove it or"),
        ("nonsense", "has no geometry; remove it or draw its polygon"),
        (feature([box(0, 0, 1, 1)], None), "property 'class' must be text that names its class"),
        (feature([box(0, 0, 1, 1)], True), "must be text that names its class, got True"),
        (feature([0, 0], kind="Point"), "is a 'Point'; a region must be a Polygon or a MultiPol"),
        (feature([]) | {"properties": 3}, "property 'class' must be text that names its class"),
        (feature([], kind="MultiPolygon"), "coordinates must be a list of polygons, got []"),
        (feature([]), "coordinates must be a list of rings, got []"),
        (feature(None), "coordinates must be a list of rings, got None"),
        (feature([box(0, 0, 1, 1)[:3]]), "coordinates[0] must be a ring of at least 4 points, the"),
        (
            feature([[box(0, 0, 1, 1), box(0, 0, 1, 1)[:3]]], kind="MultiPolygon"),
            "coordinates[0][1] must be a ring of at least 4 points",
        ),
        (feature([[*box(0, 0, 1, 1)[:4], [0, 0.1]]]), "a ring must end where it starts, but it"),
        (feature([[[0, 0], [1, "1"], [1, 0], [0, 0]]]), "coordinates[0][1][1] must be a number of"),
        (feature([[[0, 0], [True, 0], [1, 0], [0, 0]]]), "a number of metres below 1e9, got True"),
        (feature([[[0, 0], [1], [1, 0], [0, 0]]]), "must be a point [x, y] in metres, got [1]"),
        (feature([[[0, 0], [1e10, 1], [1, 0], [0, 0]]]), "coordinates[0][1][0] must be a number"),
        (feature([box(0, 0, 1, 1)], "rom"), "has class 'rom', which is not a configured label."),
    ],
)
def test_bad_features_are_refused_by_their_index(tmp_path: Path, item: Any, message: str) -> None:
    path = write(tmp_path, feature([box(0, 0, 2, 2)]), item)
    with pytest.raises(LabelError) as caught:
        load_regions(path, NAMES, grid())
    assert str(caught.value).startswith(f"{path}: feature 1")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not a JSON file: Expecting property name"),
        ("[" * 100_000, "JSON nested too deeply"),
        ("[]", "not a GeoJSON FeatureCollection (its type is None)"),
        ('{"type": "Point"}', "not a GeoJSON FeatureCollection (its type is 'Point')"),
        ('{"type": "FeatureCollection"}', "not a GeoJSON FeatureCollection"),
        ('{"type": NaN}', "not a JSON file: NaN is not a JSON number"),
        ("\xff", "not UTF-8 text; expected regions (GeoJSON)"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "x").write_bytes(text.encode("latin-1"))
    with pytest.raises(LabelError) as caught:
        read_regions(tmp_path / "x")
    assert message in str(caught.value)


def test_a_mapping_that_leads_nowhere_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, feature([box(0, 0, 2, 2)], "1PO"))
    with pytest.raises(LabelError, match="feature 0 has class '1PO', which 'classes' translates t"):
        load_regions(path, NAMES, grid(), classes={"1PO": "rooms"})
    with pytest.raises(
        LabelError, match=r"no region has a label; the file's classes are: 1PO\. Tr"
    ):
        load_regions(path, NAMES, grid(), classes={"CR": "corridor"})


def test_regions_beside_the_map_are_refused_with_both_places(tmp_path: Path) -> None:
    path = write(tmp_path, feature([box(100, 50, 101, 51)]))
    with pytest.raises(LabelError) as caught:
        load_regions(path, NAMES, grid())
    assert str(caught.value) == (
        f"{path}: no region with a label covers a cell of the map: the regions lie in x 100 to "
        "101, y 50 to 51, the map in x 0 to 8, y 0 to 6; both must be metres in the same frame"
    )
