"""Maps: what is read, what is warned about, what is refused, and that writing reads back."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pgm_places import OccupancyGrid
from pgm_places.errors import ConfigError, MapError, OutputError
from pgm_places.io.maps.map_server import correct_map, load_map, save_map
from tests.io.files import write_map

PIXELS = np.array([[254, 205, 0], [254, 254, 100]], np.uint8)


def test_a_map_is_read(tmp_path: Path) -> None:
    path = write_map(tmp_path, PIXELS, resolution="5e-2", origin="[-8.5, 3, 1.0]  # x y yaw")
    found = load_map(path)
    assert found.grid.cells.tolist() == [[0, 0, -1], [0, -1, 100]]  # the bottom row first
    assert found.grid.resolution_m == 0.05
    assert found.grid.origin_xy_m == (-8.5, 3.0)
    assert found.grid.yaw_rad == 1.0
    assert found.grid.shape == (2, 3)
    assert (found.yaml_path, found.image_path) == (path, tmp_path / "map.png")
    np.testing.assert_allclose(found.fractions, (3 / 6, 1 / 6, 2 / 6), rtol=1e-12, atol=0)
    assert found.warnings == ()
    assert found.occupancy is found.grid.cells
    assert not found.occupancy.flags.writeable


@pytest.mark.parametrize("image", ["map.bmp", "sub/map.png", "a b: c#.png", "/map.png"])
def test_any_image_file_will_do(tmp_path: Path, image: str) -> None:
    (tmp_path / "sub").mkdir()
    name = f"{tmp_path / 'sub'}{image}" if image.startswith("/") else image
    write_map(tmp_path, PIXELS, image=name)
    path = tmp_path / "hall.yaml"
    text = (tmp_path / "map.yaml").read_text()
    path.write_text(text.replace(f"image: {name}", f'image: "{name}"'))
    found = load_map(path)
    assert (found.grid.shape, found.image_path) == ((2, 3), tmp_path / name)
    assert (found.name, load_map(path.rename(tmp_path / "map.yaml")).name) == (
        "hall",
        tmp_path.name,
    )


@pytest.mark.parametrize(
    ("keys", "first"),
    [
        *(({"negate": "1"}, 100), ({"negate": "true"}, 100), ({"negate": "no"}, 0)),
        *(({"mode": "Trinary"}, 0), ({"mode": "TRINARY"}, 0), ({"mode": "rAw"}, -1)),
    ],
)
def test_negate_is_a_number_or_a_word_and_modes_may_have_capitals(
    tmp_path: Path, keys: dict[str, str], first: int
) -> None:
    assert load_map(write_map(tmp_path, PIXELS, **keys)).grid.cells[1, 0] == first


def test_scale_and_raw_keep_their_occupancy(tmp_path: Path) -> None:
    ramp = np.array([[255, 153, 128, 77, 0]], np.uint8)
    scale = load_map(
        write_map(tmp_path, ramp, mode="scale", free_thresh="0.0", occupied_thresh="1.0")
    )
    assert scale.occupancy.tolist() == [[0, 40, 50, 70, 100]]
    assert scale.grid.cells.tolist() == [[0, -1, -1, -1, 100]]
    values = np.array([[0, 19, 20, 65, 100, 101, 255]], np.uint8)
    raw = load_map(write_map(tmp_path, values, mode="raw"))
    assert raw.occupancy.tolist() == [[0, 19, 20, 65, 100, -1, -1]]
    assert raw.grid.cells.tolist() == [[0, 0, 0, 100, 100, -1, -1]]


def test_ros1_reads_colours_by_their_mean_and_alpha_as_one_of_them(tmp_path: Path) -> None:
    colours = np.array([[[255, 0, 255], [0, 255, 0]]], np.uint8)
    path = write_map(tmp_path, colours, free_thresh="0.4", occupied_thresh="0.6")
    assert load_map(path).grid.cells.tolist() == [[100, 0]]  # luma 73 and 182
    assert load_map(path, compat="ros1").grid.cells.tolist() == [[0, 100]]  # means 170 and 85
    black = np.array([[[0, 0, 0, 255], [0, 0, 0, 0]]], np.uint8)
    path = write_map(tmp_path, black)
    assert load_map(path).grid.cells.tolist() == [[100, -1]]
    # (0 + 0 + 0 + 255) / 4 is 63.75: p = 0.75
    path = write_map(tmp_path, black, occupied_thresh="0.8")
    assert load_map(path, compat="ros1").grid.cells.tolist() == [[-1, 100]]


@pytest.mark.parametrize("yaw", ["nan", "-nan", ".NaN"])
def test_a_yaw_of_nan_is_0_with_a_warning(tmp_path: Path, yaw: str) -> None:
    found = load_map(write_map(tmp_path, PIXELS, origin=f"[1, 2, {yaw}]"))
    assert found.grid.yaw_rad == 0
    (warning,) = found.warnings
    assert warning == (
        f"the yaw of the origin is {yaw} (some map savers write that); read as 0. Write a number "
        "into the YAML file if the map is rotated"
    )


@pytest.mark.parametrize(
    ("greys", "negate", "warning"),
    [
        ([205], 0, "no cell is free, so there is nothing to label; check negate and the threshold"),
        ([254], 0, "no cell is occupied: a map without walls; check negate and the thresholds"),
        ([0], 0, "no cell is free, so there is nothing to label; check negate and the thresholds"),
        ([254, 254, 254, 0], 1, "75 % of the cells are occupied, more than are free; check negate"),
    ],
)
def test_maps_of_one_kind_are_warned_about(
    tmp_path: Path, greys: list[int], negate: int, warning: str
) -> None:
    [found] = load_map(write_map(tmp_path, np.array([greys], np.uint8), negate=negate)).warnings
    assert found.startswith(warning)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"resolution": "0"}, "per cell, from 1e-06 to 1000, got 0"),
        ({"resolution": "-0.05"}, "per cell, from 1e-06 to 1000, got -0.05"),
        ({"resolution": "no"}, "key 'resolution' must be a finite decimal number"),
        ({"resolution": None}, "key 'resolution' is missing"),
        ({"origin": "[0, 0]"}, "origin must be three numbers [x, y, yaw], got ['0', '0']"),
        ({"origin": "0"}, "origin must be three numbers [x, y, yaw], got '0'"),
        ({"origin": "[nan, 0, 0]"}, "origin x must be a finite decimal number"),
        ({"origin": "[0, 1:30, 0]"}, "origin y must be a finite decimal number"),
        ({"origin": "[0, 0, inf]"}, "origin yaw must be a finite decimal number"),
        ({"mode": "trinry"}, "mode 'trinry' is unknown. Did you mean 'trinary'?"),
        ({"negate": "2.5"}, "key 'negate' must be 0, 1, true or false, got '2.5'"),
        ({"negate": None}, "key 'negate' is missing"),
        ({"free_thresh": "0.7"}, "got free_thresh 0.7 and occupied_thresh 0.65"),
        ({"free_thresh": "-0.1"}, "0 <= free_thresh <= occupied_thresh <= 1"),
        ({"occupied_thresh": "65"}, "got free_thresh 0.196 and occupied_thresh 65"),
        ({"mode": "scale", "free_thresh": "0.65"}, "(and differ in mode scale)"),
    ],
)
def test_bad_descriptions_are_refused(tmp_path: Path, keys: dict[str, Any], message: str) -> None:
    path = write_map(tmp_path, PIXELS, **keys)
    with pytest.raises(MapError) as caught:
        load_map(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize("name", ["absent.png", "x" * 300, ".", '"\\0"'])
def test_a_missing_image_names_both_files(tmp_path: Path, name: str) -> None:
    path = write_map(tmp_path, PIXELS)
    path.write_text(path.read_text().replace("image: map.png", f"image: {name}"))
    with pytest.raises(MapError) as caught:
        load_map(path)
    assert str(caught.value).startswith(f"{path}: its image ")
    assert f"no file {tmp_path}" in str(caught.value)
    assert "correct the key 'image' or put the image there" in str(caught.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"compat": "ros2"}, "compat must be 'nav2' or 'ros1', got 'ros2'"),
        ({"unknown_value": 256}, "a whole number from 0 to 255, 'none', or None, got 256"),
        ({"unknown_value": "None"}, "a whole number from 0 to 255, 'none', or None, got 'None'"),
        ({"max_pixels": 5}, "3 x 2 = 6 pixels, more than the limit of 5"),
    ],
)
def test_bad_options_are_refused(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises((MapError, ConfigError)) as caught:
        load_map(write_map(tmp_path, PIXELS), **options)
    assert message in str(caught.value)


poses = st.tuples(*[st.floats(-1e4, 1e4)] * 2, st.floats(-np.pi, np.pi))


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40
)
@given(
    height=st.integers(1, 5),
    width=st.integers(1, 5),
    resolution=st.floats(1e-3, 10),
    pose=poses,
    image_format=st.sampled_from(["png", "pgm"]),
    seed=st.integers(0, 1000),
)
def test_what_is_saved_reads_back(
    tmp_path: Path,
    height: int,
    width: int,
    resolution: float,
    pose: tuple[float, float, float],
    image_format: Any,
    seed: int,
) -> None:
    cells = np.random.default_rng(seed).choice(np.array([-1, 0, 100], np.int8), (height, width))
    grid = OccupancyGrid(cells, resolution, pose[:2], pose[2])
    path = save_map(grid, tmp_path / "map", image_format=image_format)
    for compat in ("nav2", "ros1"):
        found = load_map(path, compat=compat).grid
        assert (found.cells == grid.cells).all()
        assert found.resolution_m == grid.resolution_m
        assert found.origin_xy_m == grid.origin_xy_m
        assert found.yaw_rad == grid.yaw_rad


def test_saving_keeps_odd_names_and_refuses_what_cannot_be(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.array([[0, 100]], np.int8), 0.05)
    path = save_map(grid, tmp_path / 'v1.2 "no": x')
    assert path.name == 'v1.2 "no": x.yaml'
    assert (load_map(path).grid.cells == grid.cells).all()
    assert len(list(tmp_path.iterdir())) == 2
    with pytest.raises(ConfigError, match="image_format must be 'png' or 'pgm', got 'jpg'"):
        save_map(grid, tmp_path / "map", image_format="jpg")  # type: ignore[arg-type]
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        save_map(grid, tmp_path / "file" / "map")


@pytest.mark.parametrize(
    ("rows", "negate", "warning"),
    [
        ({216: 64, 0: 8}, 0, "64 % of the pixels have grey 216 and read as free, as grey 254 does"),
        ({250: 64, 0: 8}, 0, None),
        ({120: 64, 0: 8}, 0, None),
        ({216: 50, 235: 10, 0: 2}, 0, "50 % of the pixels have grey 216 and read as free"),
        ({38: 60, 0: 30, 255: 10}, 1, "60 % of the pixels have grey 38 and read as free, as grey"),
    ],
)
def test_a_frequent_grey_beside_a_freer_one_is_named(
    tmp_path: Path, rows: dict[int, int], negate: int, warning: str | None
) -> None:
    greys = np.repeat([*rows, 254], [*rows.values(), 100 - sum(rows.values())]).astype(np.uint8)
    path = write_map(tmp_path, np.tile(greys[:, None], 100), negate=negate)
    named = [line for line in load_map(path).warnings if "read as free" in line]
    assert [line[: len(warning or "")] for line in named] == ([warning] if warning else [])
    grey, share = next(iter(rows.items()))
    asked = load_map(path, unknown_value=grey)
    assert asked.warnings == () and asked.fractions.unknown == pytest.approx(share / 100)


@pytest.mark.parametrize(
    "image", ["/home/robot/maps/map.png", "C:\\\\maps\\\\map.png", "../maps/map.png"]
)
def test_an_image_that_lies_beside_is_found_and_the_file_corrected(
    tmp_path: Path, image: str
) -> None:
    path = write_map(tmp_path, PIXELS)
    path.write_text(path.read_text().replace("image: map.png", f'image: "{image}"  # mine'))
    found = load_map(path)
    assert found.image_path == tmp_path / "map.png"
    [warning] = [line for line in found.warnings if "is missing" in line]
    assert warning.endswith("'pgm-places doctor map.yaml --fix' corrects the file")
    assert found.corrections["image"] == "map.png"
    if "\\" not in image:  # of an escaped text, another than the file's stands there
        correct_map(path, {"image": "map.png"})
        assert 'image: "map.png"  # mine' in path.read_text()
        assert load_map(path).warnings == ()


@pytest.mark.parametrize("is_there", [True, False])
def test_a_picture_is_answered_with_its_description(tmp_path: Path, is_there: bool) -> None:
    path = write_map(tmp_path, PIXELS)
    if not is_there:
        path.unlink()
    expected = r"\(YAML\), .*map\.yaml$" if is_there else r"which names it: 'image: map\.png'$"
    with pytest.raises(MapError, match=rf"map\.png is the picture of a map; .*{expected}"):
        load_map(tmp_path / "map.png")


def test_a_key_that_is_there_is_not_offered_for_one_that_is_missing(tmp_path: Path) -> None:
    path = write_map(tmp_path, PIXELS)
    path.write_text(path.read_text().replace("occupied_thresh: 0.65\n", ""))
    with pytest.raises(MapError, match=r"key 'occupied_thresh' is missing\. Keys of the file: fre"):
        load_map(path)
    path.write_text(path.read_text() + "ocupied_thresh: 0.65\n")
    with pytest.raises(MapError, match=r"missing\. Did you mean 'ocupied_thresh'"):
        load_map(path)


def test_all_missing_keys_are_named_at_once(tmp_path: Path) -> None:
    path = write_map(tmp_path, PIXELS)
    path.write_text("image: map.png\nresolution: 0.05\n")
    words = r"keys 'origin', 'negate', 'occupied_thresh', 'free_thresh' are missing\. Keys of the "
    with pytest.raises(MapError, match=words + r"file: image, resolution$"):
        load_map(path)


def test_the_names_of_a_label_image_are_no_map(tmp_path: Path) -> None:
    path = tmp_path / "labels.yaml"
    path.write_text("values: {room: 77}\nignore: 0\n")
    with pytest.raises(MapError, match="these are the names of a label image; give the map's"):
        load_map(path)


LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("map.png", LFS, "a pointer of Git LFS, .*'git lfs pull'"),
        ("map.yaml", LFS, "a pointer of Git LFS, .*'git lfs pull'"),
        ("map.png", b"GIF89a", r"not an image \(PNG, PGM, PBM, PPM, BMP, TIFF or JPEG\)"),
        ("map.png", None, "the image is damaged or truncated"),
    ],
)
def test_other_files_are_refused(
    tmp_path: Path, name: str, content: bytes | None, message: str
) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (50, 50), np.uint8)
    path = write_map(tmp_path, noise)
    (tmp_path / name).write_bytes(content or (tmp_path / name).read_bytes()[:900])
    with pytest.raises(MapError, match=f"{name}: {message}"):
        load_map(path)
