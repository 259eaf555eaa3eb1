"""Exports opened by what their readers use: GDAL for QGIS, MCAP's own library for Foxglove."""

import dataclasses
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from pgm_places.errors import InputError, OutputError
from pgm_places.io.places.exports import export
from pgm_places.io.places.place_bag import class_grid, write_place_bag
from tests.topology.floors import floor_labels, floor_map, gated_floor_map

FRAME = {"yaw_rad": 0.4, "origin_xy_m": (5.0, -3.0)}


def test_gdal_reads_valid_polygons_in_metres_and_the_route_graph(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    [path] = export(topology, "regions", tmp_path)
    assert pyogrio.read_info(path)["crs"] == "EPSG:3857"
    meta, _, wkb, columns = pyogrio.raw.read(path)
    fields = dict(zip(meta["fields"], columns, strict=True))
    assert fields["id"].tolist() == [region.id for region in topology.regions]
    assert fields["class"].tolist() == [region.label for region in topology.regions]
    shapes = shapely.from_wkb(wkb)
    assert shapely.is_valid(shapes).all()
    for region, shape in zip(topology.regions, shapes, strict=True):
        assert shapely.contains_xy(shape, *region.anchor_m)
        assert shape.area == pytest.approx(region.area_m2, rel=0.05)
    meta, _, wkb, _ = pyogrio.raw.read(export(topology, "nav2-route", tmp_path)[0])
    assert {"id", "startid", "endid"} <= set(meta["fields"])
    assert set(shapely.get_type_id(shapely.from_wkb(wkb))) == {0, 5}  # Point, MultiLineString


@pytest.mark.parametrize("name", ["regions.tif", "labels.tif"])
def test_gdal_finds_each_place_where_it_is(name: str, tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    export(topology, "geotiff", tmp_path)
    with rasterio.open(tmp_path / name) as image:
        assert image.crs.to_epsg() == 3857
        assert image.nodata == 0
        assert image.transform.b != 0  # turned, as the map is
        band = image.read(1)
        for region in topology.regions:
            row, column = image.index(*region.anchor_m)
            number = 1 + topology.label_names.index(region.label)
            assert band[row, column] == (region.id if name == "regions.tif" else number)


def test_every_line_is_graphvizs_syntax_even_with_odd_names(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    odd = dataclasses.replace(topology.regions[0], name='Anna\'s "room" \\ a\nb')
    [path] = export(
        dataclasses.replace(topology, regions=(odd, *topology.regions[1:])), "dot", tmp_path
    )
    text = r'"(?:[^"\\]|\\.)*"'
    value = rf"(?:{text}|\w+)"
    attributes = rf"\[\w+={value}(?:, \w+={value})*\];"
    statement = re.compile(rf"  \d+(?: -- \d+)? {attributes}")
    first, *lines, last = path.read_text().splitlines()
    assert (first, last) == ("graph places {", "}")
    assert [line for line in lines if not statement.fullmatch(line)] == []
    assert len(lines) == len(topology.regions) + len(topology.connections)


def read_bag(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        return {channel.topic: message for _, channel, _, message in messages}


def test_mcap_holds_a_grid_in_the_maps_frame(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    [metadata, mcap] = export(topology, "mcap", tmp_path)
    assert (metadata.name, mcap.name) == ("metadata.yaml", "places.mcap")
    grid = read_bag(mcap)["/place_classes"]
    assert grid.header.frame_id == "map"
    assert (grid.info.height, grid.info.width) == topology.grid.shape
    assert grid.info.resolution == topology.grid.resolution_m
    turn = grid.info.origin.orientation
    assert 2 * np.arctan2(turn.z, turn.w) == pytest.approx(0.4)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == (5.0, -3.0)
    values = np.array(grid.data).reshape(topology.grid.shape)
    labels = floor_labels()
    assert (values == np.where(labels < 0, -1, labels + 1)).all()
    assert (values == class_grid(topology)).all()


def test_mcap_markers_cover_and_name_each_place(tmp_path: Path) -> None:
    topology = floor_map(**FRAME)
    bag = write_place_bag(tmp_path / "bag", topology)[1]
    markers = {(m.ns, m.id): m for m in read_bag(bag)["/places"].markers}
    assert len(markers) == 3 * len(topology.regions) + 2
    for region in topology.regions:
        corners = np.array([(p.x, p.y) for p in markers["areas", region.id].points])
        (ax, ay), (bx, by), (cx, cy) = corners.reshape(-1, 3, 2).transpose(1, 2, 0)
        turned = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        assert (turned > 0).all()  # seen from above
        assert turned.sum() / 2 == pytest.approx(region.area_m2)
        name = markers["names", region.id]
        assert name.text == region.name
        assert (name.pose.position.x, name.pose.position.y) == pytest.approx(region.anchor_m)
        assert len(markers["outlines", region.id].points) % 2 == 0
    assert len(markers["passages", 0].points) == len(topology.connections)


def test_mcap_markers_show_the_rectangles_of_gates(tmp_path: Path) -> None:
    topology = gated_floor_map(**FRAME)
    bag = write_place_bag(tmp_path / "bag", topology)[1]
    [marker] = [m for m in read_bag(bag)["/places"].markers if m.ns == "gates"]
    [region] = [region for region in topology.regions if region.gate is not None]
    assert region.gate is not None
    assert (marker.id, marker.type) == (region.id, 4)  # LINE_STRIP
    corners = region.gate.corners_m.tolist()
    np.testing.assert_allclose(
        [(p.x, p.y) for p in marker.points], [*corners, corners[0]], rtol=0, atol=1e-12
    )


def test_a_bag_is_replaced_and_other_folders_are_not(tmp_path: Path) -> None:
    topology = floor_map()
    first = write_place_bag(tmp_path / "bag", topology)[1].read_bytes()
    assert write_place_bag(tmp_path / "bag", topology)[1].read_bytes() == first
    (tmp_path / "bag" / "note.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds other files"):
        write_place_bag(tmp_path / "bag", topology)


def test_without_rosbags_the_message_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(InputError, match=r'pip install .*\[bags\]"'):
        write_place_bag(tmp_path / "bag", floor_map())
