"""The files that readers must get right, and the real buildings."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pgm_places.errors import LabelError
from pgm_places.io.maps.label_image import load_labels, save_labels
from pgm_places.io.maps.label_values import listed_names
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.maps.coarsening import coarsen
from tests.real_data import real_data_folder
from tests.reference.coarse_blocks import passable_doors

pytestmark = pytest.mark.real_data

NAMES = ["corridor", "room", "doorway"]
CLASSES = {"CR": "corridor", "DW": "doorway"} | dict.fromkeys(
    ("1PO", "2PO", "LO", "KT", "PT", "PA", "CF", "RL", "TR"), "room"
)
# Nav2's own test: 1 is occupied, the bottom row first.
TESTMAP = [
    *("0000000000", "1111001110", "1111001110", "1000000000", "1000000000"),
    *("1000001100", "1000001100", "1000001100", "1000001100", "1000000000"),
]


def copied(name: str, folder: Path, **changes: str) -> Path:
    """A description of the real data beside another image."""
    text = (real_data_folder("formats") / name).read_text()
    lines = [line for line in text.splitlines() if line.split(":")[0] not in changes]
    path = folder / name
    path.write_text("\n".join([*lines, *(f"{k}: {v}" for k, v in changes.items()), ""]))
    return path


@pytest.mark.parametrize("suffix", ["png", "pgm", "bmp"])
def test_nav2s_test_map(tmp_path: Path, suffix: str) -> None:
    image = real_data_folder("formats") / f"testmap.{suffix}"
    found = load_map(copied("testmap.yaml", tmp_path, image=str(image)))
    expected = np.array([[100 * int(digit) for digit in row] for row in TESTMAP])
    assert (found.grid.cells == expected).all()
    assert found.grid.resolution_m == 0.1
    assert (*found.grid.origin_xy_m, found.grid.yaw_rad) == (2.0, 3.0, 1.0)
    assert (
        load_map(copied("testmap.yaml", tmp_path, image=str(image)), compat="ros1").warnings == ()
    )


@pytest.mark.parametrize(
    ("folder", "name", "shape", "shares"),
    [
        ("formats", "UMA_236", (1863, 333), (20.7, 1.2, 78.1)),
        ("formats", "tb3_sandbox", (384, 384), (5.4, 0.6, 94.0)),
        ("freiburg079", "map", (289, 700), (63.7, 14.9, 21.3)),
        ("freiburg079", "log_map", (328, 894), (55.3, 5.8, 38.9)),
        ("freiburg079_drawn", "map", (544, 800), (29.5, 2.0, 68.5)),
        ("freiburg079_partial", "map8", (736, 1152), (16.2, 1.3, 82.5)),
        ("freiburg052", "map", (292, 543), (58.2, 11.2, 30.6)),
        ("intel", "map", (587, 586), (56.4, 7.5, 36.1)),
        ("cold_saarbrucken_seq3", "map", (5504, 4992), (1.1, 0.0, 98.8)),
    ],
)
def test_maps_of_robots(
    folder: str, name: str, shape: tuple[int, int], shares: tuple[float, float, float]
) -> None:
    found = load_map(real_data_folder(folder) / f"{name}.yaml")
    assert found.grid.shape == shape
    np.testing.assert_allclose(np.multiply(found.fractions, 100), shares, rtol=0, atol=0.051)
    assert found.warnings == ()


@pytest.mark.parametrize("folder", ["freiburg079", "freiburg052", "freiburg079_drawn"])
def test_labels_lie_on_free_cells_and_doors_stay_open_when_coarse(folder: str) -> None:
    data = real_data_folder(folder)
    grid = load_map(data / "map.yaml").grid
    labels = load_labels(data / "labels.png", NAMES, grid=grid)
    assert (labels >= 0).sum() == np.count_nonzero(np.asarray(Image.open(data / "labels.png")))
    assert grid.free[labels >= 0].all()
    coarse = coarsen(grid, 4 * grid.resolution_m)
    free = np.kron(coarse.free, np.ones((4, 4), np.bool_))[: grid.shape[0], : grid.shape[1]]
    doors = passable_doors(grid.free, free, labels, NAMES.index("doorway"), reach=8)
    assert len(doors) >= 10
    assert all(doors)


@pytest.mark.parametrize(
    ("folder", "map_name", "regions"),
    [
        ("cold_freiburg_seq1", "map", "regions"),
        ("cold_saarbrucken_seq4", "map", "regions"),
        ("freiburg079", "log_map", "log_regions"),
    ],
)
def test_regions_cover_the_places_they_name(folder: str, map_name: str, regions: str) -> None:
    data = real_data_folder(folder)
    grid = load_map(data / f"{map_name}.yaml").grid
    labels = load_regions(data / f"{regions}.geojson", NAMES, grid, classes=CLASSES)
    corridor = labels == NAMES.index("corridor")
    assert grid.free[corridor].mean() > 0.9  # a shifted or mirrored frame would hit the walls
    assert set(np.unique(labels)) == {-1, 0, 1, 2}


@pytest.mark.parametrize(("kind", "step"), [("freiburg0*", 1), ("robots/*", 5), ("floors/*", 10)])
def test_label_images_lie_on_their_maps_as_they_are_and_not_flipped(
    kind: str, step: int, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    root = real_data_folder("robots").parent
    paths = sorted(root.glob(f"{kind}/labels.png"))[::step]
    assert len(paths) >= 3
    accepted = []
    for path in paths:
        grid, names = load_map(path.parent / "map.yaml").grid, listed_names(path)
        labels = load_labels(path, names, grid=grid)
        flipped, _ = save_labels(tmp_path / "flipped.png", labels[:, ::-1], names)
        try:
            load_labels(flipped, names, grid=grid)
            accepted.append(path)
        except LabelError as error:
            if "lie on free cells of the map, the other way 100.0 % would" not in str(error):
                accepted.append(path)
    assert accepted == []
    assert caplog.messages == []
