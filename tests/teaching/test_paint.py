"""Paint: cells, files, classes."""

import json
from pathlib import Path

import numpy as np
import pytest

from pgm_places import OccupancyGrid
from pgm_places.errors import LabelError
from pgm_places.teaching.paint import Paint
from tests.refusals import refused

CLASSES = ("corridor", "room", "doorway")
GRID = OccupancyGrid(np.zeros((12, 16), np.int8), 0.5, (-3.0, 2.0), 0.3)


def painted() -> Paint:
    labels = np.full(GRID.shape, -1, np.int16)
    labels[2:6, 3:9] = 1
    labels[3:5, 4:6] = -1  # a hole
    labels[8, 1:4], labels[9, 4] = 2, 2  # corner to corner
    return Paint(labels, CLASSES)


@pytest.mark.parametrize("name", ["paint.png", "paint.geojson"])
def test_files_hold_every_painted_cell_and_no_other(name: str, tmp_path: Path) -> None:
    path = painted().save(tmp_path / name, GRID)
    found = Paint.read(path, GRID, CLASSES)
    np.testing.assert_array_equal(found.labels, painted().labels)
    assert found.classes == CLASSES


def test_an_image_names_its_classes_and_may_hold_a_part_of_those_wanted(tmp_path: Path) -> None:
    path = painted().save(tmp_path / "paint.png", GRID)
    assert Paint.read(path, GRID).classes == CLASSES
    more = ("kitchen", *CLASSES)
    np.testing.assert_array_equal(
        Paint.read(path, GRID, more).labels[painted().painted],
        painted().labels[painted().painted] + 1,
    )
    refused(LabelError, "'doorway', not a configured label", Paint.read, path, GRID, CLASSES[:2])


def line(points: list[list[float]], **properties: object) -> dict[str, object]:
    geometry = {"type": "LineString", "coordinates": points}
    return {
        "type": "Feature",
        "geometry": geometry,
        "properties": {"class": "doorway"} | properties,
    }


def test_lines_are_as_wide_as_they_say(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((40, 40), np.int8), 0.05)
    path = tmp_path / "lines.geojson"
    path.write_text(
        json.dumps(
            {
                "type": "FeatureCollection",
                "features": [
                    line([[0.5, 0.5], [1.5, 0.5]]),
                    line([[0.5, 1.0], [0.5, 1.5]], width_m=0.4),
                ],
            }
        )
    )
    found = Paint.read(path, grid, CLASSES).painted
    wanted = np.zeros(grid.shape, bool)
    wanted[8:12, 10:30] = True
    wanted[20:30, 6:14] = True
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    ("feature", "says"),
    [
        (line([[0, 0]]), "feature 0: coordinates.*at least two points"),
        (line([[0, 0], [1, 1]], width_m=-1), "property 'width_m' must be a width in metres, got -"),
        (line([[0, 0], [1, 1]]) | {"geometry": {"type": "Point", "coordinates": [0, 0]}}, "Point"),
    ],
)
def test_lines_that_are_none_are_refused(
    feature: dict[str, object], says: str, tmp_path: Path
) -> None:
    path = tmp_path / "lines.geojson"
    path.write_text(json.dumps(feature))
    refused(LabelError, says, Paint.read, path, GRID, CLASSES)


def test_classes_are_added_and_only_unpainted_ones_are_dropped() -> None:
    more = painted().with_classes(["room", "kitchen", "doorway"])
    assert more.counts == {"room": painted().counts["room"], "kitchen": 0, "doorway": 4}
    with pytest.raises(LabelError, match="'room' is painted on the map and must stay"):
        painted().with_classes(["corridor", "doorway"])


def test_wiping_and_masks() -> None:
    paint = painted().with_cells(np.argwhere(np.ones(GRID.shape, bool)), None)
    assert not paint.painted.any()
    assert paint.with_cells([[0, 0]], "room").with_cells([[0, 0]], None).counts["room"] == 0
    refused(LabelError, "'attic' is not among the classes", paint.with_cells, [[0, 0]], "attic")


def test_the_classes_of_geojson_are_those_that_it_uses(tmp_path: Path) -> None:
    labels = np.full(GRID.shape, -1, np.int16)
    labels[np.unravel_index(np.flatnonzero(GRID.free)[:3], GRID.shape)] = 1
    path = Paint(labels, ("room", "lab")).save(tmp_path / "x.geojson", GRID)
    found = Paint.read(path, GRID)
    assert found.classes == ("lab",)
    np.testing.assert_array_equal(found.labels, np.where(labels == 1, 0, -1))
