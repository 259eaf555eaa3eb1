"""Label images and their names files: round trips, conventions, refusals."""

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from pgm_places import OccupancyGrid
from pgm_places.errors import LabelError
from pgm_places.io.maps.label_image import load_labels, save_labels
from pgm_places.io.maps.label_values import LABEL_COLOURS, default_values, palette_of

NAMES = ["corridor", "room"]
PIXELS = np.array([[77, 77, 0], [115, 0, 0]], np.uint8)  # the top row first
LABELS = [[0, -1, -1], [1, 1, -1]]  # the bottom row first
VALUES = "ignore: 0\nvalues: {room: 77, corridor: 115}\n"


def free_grid(*shape: int) -> OccupancyGrid:
    return OccupancyGrid(np.zeros(shape, np.int8), 0.05)


def write(folder: Path, pixels: Any = PIXELS, text: str = VALUES, name: str = "labels.png") -> Path:
    picture = pixels if isinstance(pixels, Image.Image) else Image.fromarray(np.asarray(pixels))
    picture.save(folder / name)
    (folder / "labels.yaml").write_text(text)
    return folder / name


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "LA"])
def test_labels_are_read_in_the_grids_order_from_any_kind_of_grey(
    tmp_path: Path, mode: str
) -> None:
    path = write(tmp_path, Image.fromarray(PIXELS).convert(mode), name="truth.tiff")
    labels = load_labels(path, NAMES, grid=free_grid(2, 3))
    assert labels.tolist() == LABELS and labels.dtype == np.int16


def test_transparent_pixels_have_no_label(tmp_path: Path) -> None:
    picture = Image.fromarray(np.array([[77, 77, 9], [115, 0, 0]], np.uint8)).convert("LA")
    alpha = np.array([[255, 0, 0], [255, 255, 255]], np.uint8)
    picture.putalpha(Image.fromarray(alpha))
    labels = load_labels(write(tmp_path, picture), NAMES, grid=free_grid(2, 3))
    assert labels.tolist() == [[0, -1, -1], [1, -1, -1]]


def test_an_indexed_image_counts_by_its_greys_or_else_by_its_indices(tmp_path: Path) -> None:
    indices = np.array([[1, 1, 0], [2, 0, 0]], np.uint8)
    grey = Image.fromarray(indices).convert("P")
    grey.putpalette([0, 0, 0, 77, 77, 77, 115, 115, 115, 255, 0, 0])
    assert load_labels(write(tmp_path, grey), NAMES, grid=free_grid(2, 3)).tolist() == LABELS
    coloured = Image.fromarray(indices).convert("P")
    coloured.putpalette([0, 0, 0, 255, 0, 0, 0, 0, 255])
    path = write(tmp_path, coloured, "ignore: 0\nvalues: {room: 1, corridor: 2}\n")
    assert load_labels(path, NAMES, grid=free_grid(2, 3)).tolist() == LABELS


@pytest.mark.parametrize("mode", ["P", "RGB", "RGBA", "L", "reordered"])
@pytest.mark.parametrize("n_labels", [1, 2, 3, 9, 40])
def test_what_is_written_is_read_back_however_an_editor_saves_it(
    tmp_path: Path, mode: str, n_labels: int
) -> None:
    names = [f"place {k}" for k in range(n_labels)]
    labels = np.random.default_rng(n_labels).integers(-1, n_labels, (9, 11))
    path, _ = save_labels(tmp_path / "labels.png", labels, names)
    with Image.open(path) as picture:
        picture.load()
    if mode == "reordered":  # as editors number colours: in the order in which they first appear
        stored = np.asarray(picture)
        old, first = np.unique(stored, return_index=True)
        old = old[np.argsort(first)]
        number = np.zeros(256, np.uint8)
        number[old] = np.arange(len(old)) + 1
        palette = np.zeros((256, 3), np.uint8)
        palette[1 : len(old) + 1] = palette_of(list(default_values(names).values()))[old]
        changed = Image.fromarray(number[stored]).convert("P")
        changed.putpalette(palette.ravel().tolist())
    elif mode == "L":
        changed = Image.fromarray(np.asarray(picture))
    else:
        changed = picture.convert(mode) if mode != "P" else picture
    changed.save(path)
    assert (load_labels(path, names, grid=free_grid(9, 11)) == labels).all()


def test_pixels_of_other_colours_may_be_transparent_and_greys_may_be_ignored(
    tmp_path: Path,
) -> None:
    pixels = np.zeros((1, 4, 4), np.uint8)
    pixels[0, :, :3] = [LABEL_COLOURS[0], (9, 8, 7), (255, 255, 255), (115, 115, 115)]
    pixels[0, :, 3] = [255, 0, 255, 255]
    text = "ignore: [0, 255]\nvalues: {room: 77, corridor: 115}\n"
    path = write(tmp_path, Image.fromarray(pixels), text)
    assert load_labels(path, NAMES, grid=free_grid(1, 4)).tolist() == [[1, -1, -1, 0]]


def test_labels_that_are_ignored_keep_their_colour(tmp_path: Path) -> None:
    labels = np.array([[0, 1, 2, -1]])
    path, listed = save_labels(tmp_path / "labels.png", labels, ["stairs", *NAMES])
    with Image.open(path) as picture:
        changed = picture.convert("RGB")
    changed.save(path)
    listed.write_text("ignore: [0, 85]\nvalues: {corridor: 170, room: 255}\n")
    assert load_labels(path, NAMES, grid=free_grid(1, 4)).tolist() == [[-1, 0, 1, -1]]


def test_names_are_translated_and_the_rest_has_no_label_unless_a_star_gives_it_one(
    tmp_path: Path,
) -> None:
    grid = free_grid(2, 3)
    text = "ignore: 0\nvalues: {stairs: 77, lobby: 115, office: 200}\n"
    path = write(tmp_path, np.array([[77, 200, 0], [115, 0, 0]], np.uint8), text)
    named = {"lobby": "corridor", "office": "room"}
    assert load_labels(path, NAMES, grid=grid, classes=named).tolist() == [[0, -1, -1], [-1, 1, -1]]
    rest = {"lobby": "corridor", "*": "room"}
    assert load_labels(path, NAMES, grid=grid, classes=rest).tolist() == [[0, -1, -1], [1, 1, -1]]
    rest["stairs"] = ""
    assert load_labels(path, NAMES, grid=grid, classes=rest).tolist() == [[0, -1, -1], [-1, 1, -1]]
    with pytest.raises(
        LabelError, match=r"'classes' translates to 'rooms', not a configured label"
    ):
        load_labels(path, NAMES, grid=grid, classes={"office": "rooms"})


def test_the_names_file_is_the_images_own_or_the_folders_or_a_given_one(tmp_path: Path) -> None:
    path = write(tmp_path, name="truth.png")
    assert load_labels(path, NAMES, grid=free_grid(2, 3)).tolist() == LABELS
    swapped = [[1, -1, -1], [0, 0, -1]]
    (tmp_path / "truth.yaml").write_text("ignore: [0]\nvalues: {room: 115, corridor: 77}\n")
    assert load_labels(path, NAMES, grid=free_grid(2, 3)).tolist() == swapped
    given_path = tmp_path / "labels.yaml"
    labels = load_labels(path, NAMES, grid=free_grid(2, 3), names_path=given_path)
    assert labels.tolist() == LABELS
    (tmp_path / "truth.yaml").unlink()
    given_path.unlink()
    with pytest.raises(LabelError) as caught:
        load_labels(path, NAMES, grid=free_grid(2, 3))
    assert str(caught.value) == (
        f"{path}: its grey values have no names: neither truth.yaml nor labels.yaml exists "
        "in its folder. Write one, e.g. 'values: {room: 77, corridor: 115}' and 'ignore: 0'"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ignore: 0\nvalues: {room: 77}\n", "the configured label 'corridor' has no grey value"),
        ("ignore: 0\nvalues: {rooms: 77, corridor: 115}\n", "label 'rooms' is not among the"),
        ("ignore: 0\n", "key 'values' is missing"),
        ("values: [77]\n", "key 'values' must map label names to grey values, e.g. {room: 77}"),
        ("values: {room: 77.5, corridor: 1}\n", "the grey value of 'room' must be a whole number"),
        ("values: {room: 256, corridor: 1}\n", "must be a whole number from 0 to 255, got '256'"),
        ("values: {room: 7, corridor: 7}\n", "grey value 7 stands for 'corridor' and for 'room'"),
        ("ignore: [0, 77]\n" + VALUES[10:], "grey value 77 stands for 'room' and for 'ignore'"),
        ("ignore: no\n" + VALUES[10:], "key 'ignore' must be a whole number from 0 to 255"),
        ("ignored: 0\n" + VALUES[10:], "key 'ignored' is unknown. Did you mean 'ignore'?"),
    ],
)
def test_bad_names_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(LabelError) as caught:
        load_labels(write(tmp_path, text=text), NAMES, grid=free_grid(2, 3))
    assert str(caught.value).startswith(f"{tmp_path / 'labels.yaml'}: ")
    assert message in str(caught.value)


def swapped() -> Image.Image:
    """Whose indices and colours stand for different labels."""
    picture = Image.fromarray(np.array([[1, 1, 0], [2, 0, 0]], np.uint8)).convert("P")
    picture.putpalette([0, 0, 0, *LABEL_COLOURS[1], *LABEL_COLOURS[0]])
    return picture


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (
            np.array([[[77, 77, 77], [9, 8, 7]]], np.uint8),
            "the colour #090807 at row 0 from the top, column 1 is not one of the label image's: "
            "room #0072b2, corridor #e69f00, black for none; draw with these colours, without "
            "anti-aliasing, or save it as greyscale or as an indexed image",
        ),
        (np.array([[77, 115]], np.uint16), "16-bit grey values, but label values are 0 to 255"),
        (np.array([[0, 0]], np.uint8), "no pixel has a label; are all its values under 'ignore'?"),
        (np.array([[77, 78, 78], [115, 116, 0]], np.uint8), "grey values without a name: 78 (2"),
        (np.arange(12, dtype=np.uint8).reshape(3, 4), "grey values without a name: 1 (1 pixels),"),
        (
            swapped(),
            "its indices and its colours stand for different labels: index 1 has the colour "
            "#e69f00, which stands for 2 (room #0072b2, corridor #e69f00, black for none); save it "
            "as RGB or as greyscale",
        ),
        (PIXELS[:, :2], "the labels have 2 rows x 2 columns, the map has 2 x 3; draw the labels"),
    ],
)
def test_bad_images_are_refused(tmp_path: Path, pixels: Any, message: str) -> None:
    indices = isinstance(pixels, Image.Image)
    path = write(
        tmp_path, pixels, "ignore: 0\nvalues: {room: 1, corridor: 2}" if indices else VALUES
    )
    shape = (2, 3) if indices or "the map has" in message else pixels.shape[:2]
    with pytest.raises(LabelError) as caught:
        load_labels(path, NAMES, grid=free_grid(*shape))
    assert str(caught.value).startswith(f"{path}: {message.replace('FOLDER', str(tmp_path))}")


def test_a_jpeg_of_labels_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path)
    Image.fromarray(PIXELS).save(path, "JPEG")
    with pytest.raises(LabelError, match=r"a JPEG, whose compression changes values; save the im"):
        load_labels(path, NAMES, grid=free_grid(2, 3))


def l_shaped() -> tuple[OccupancyGrid, np.ndarray]:
    """A map that differs from its mirror image, and labels on all its free cells."""
    cells = np.full((10, 10), 100, np.int8)
    cells[1:3, 1:9] = cells[1:6, 1:3] = 0
    return OccupancyGrid(cells, 0.05), np.where(cells == 0, 0, -1)


def test_an_image_that_lies_the_wrong_way_is_refused(tmp_path: Path) -> None:
    grid, labels = l_shaped()
    save_labels(tmp_path / "up.png", labels, NAMES)
    assert (load_labels(tmp_path / "up.png", NAMES, grid=grid) == labels).all()
    save_labels(tmp_path / "down.png", labels[::-1], NAMES)
    with pytest.raises(LabelError) as caught:
        load_labels(tmp_path / "down.png", NAMES, grid=grid)
    assert str(caught.value) == (
        f"{tmp_path / 'down.png'}: the label image is upside down: only 18.2 % of the labelled "
        "pixels lie on free cells of the map, the other way 100.0 % would; flip it vertically"
    )


def test_labels_of_another_map_are_warned_about(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    grid, _ = l_shaped()
    labels = np.full((10, 10), -1)
    labels[4:9, 4:9] = 0  # whichever way it lies, little of it is on free cells
    save_labels(tmp_path / "x.png", labels, NAMES)
    with caplog.at_level(logging.WARNING):
        load_labels(tmp_path / "x.png", NAMES, grid=grid)
    assert caplog.messages == [
        f"{tmp_path / 'x.png'}: only 0.0 % of the labelled pixels lie on free cells of the map, "
        "the other way 64.0 % would; is it turned by 180 degrees, or do the labels belong to "
        "another map?"
    ]


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40
)
@given(
    shape=st.tuples(st.integers(1, 6), st.integers(1, 6)),
    n_labels=st.one_of(st.integers(1, 9), st.just(40)),
    seed=st.integers(0, 1000),
)
def test_what_is_saved_reads_back(
    tmp_path: Path, shape: tuple[int, int], n_labels: int, seed: int
) -> None:
    names = [f"label {k}: é" for k in range(n_labels)]
    labels = np.random.default_rng(seed).integers(-1, n_labels, shape)
    labels[0, 0] = 0
    image, text = save_labels(tmp_path / "labels.png", labels, names)
    assert text == tmp_path / "labels.yaml"
    assert (load_labels(image, names, grid=free_grid(*shape)) == labels).all()
    backwards = load_labels(image, names[::-1], grid=free_grid(*shape))
    assert (backwards == np.where(labels < 0, -1, n_labels - 1 - labels)).all()


def test_the_picture_is_indexed_in_distinct_colours_on_the_images_own_raster(
    tmp_path: Path,
) -> None:
    names = [f"label {k}" for k in range(20)]
    save_labels(tmp_path / "x.png", [[-1, 0], [1, 19]], names)
    with Image.open(tmp_path / "x.png") as picture:
        assert picture.mode == "P"
        colours = np.asarray(picture.convert("RGB"))
        assert np.asarray(picture).tolist() == [[24, 240], [0, 12]]
    assert tuple(colours[1, 1]) == LABEL_COLOURS[0]
    assert tuple(colours[1, 0]) == (0, 0, 0)
    values = default_values([str(k) for k in range(20)])
    save_labels(tmp_path / "all.png", np.arange(20)[None], names)
    with Image.open(tmp_path / "all.png") as picture:
        assert np.asarray(picture).tolist() == [list(values.values())]
        assert len(np.unique(np.asarray(picture.convert("RGB"))[0], axis=0)) == 20


@pytest.mark.parametrize(
    ("labels", "names", "message"),
    [
        ([[0, 2]], NAMES, "raster must hold labels from 0 to 1, or -1 for none, got values from 0"),
        ([[0, -2]], NAMES, "got values from -2 to 0"),
        ([[0.0, 1.0]], NAMES, "raster must hold integers, got dtype float64"),
        ([0, 1], NAMES, "raster must have shape (H, W), got (2,)"),
        ([[0]], ["a", "a"], "label_names must be 1 to 255 distinct names, got ['a', 'a']"),
        ([[0]], [str(k) for k in range(256)], "label_names must be 1 to 255 distinct names"),
    ],
)
def test_what_cannot_be_saved_is_refused(
    tmp_path: Path, labels: Any, names: list[str], message: str
) -> None:
    with pytest.raises(LabelError) as caught:
        save_labels(tmp_path / "x.png", labels, names)
    assert message in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("n_labels", [1, 2, 3, 7, 100, 255])
def test_default_values_are_spread_and_never_0(n_labels: int) -> None:
    values = list(default_values([str(k) for k in range(n_labels)]).values())
    assert len(set(values)) == n_labels
    assert min(values) >= 1
    assert max(values) <= 255
    assert len(set(np.diff([0, *values]).tolist())) == 1


def test_a_missing_image_is_named_before_its_names(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), resolution_m=1)
    for name in ("labels.png", "floor.png"):
        with pytest.raises(LabelError, match=f"{name}: no such file; expected a label image"):
            load_labels(tmp_path / name, ("room",), grid=grid)


def test_a_name_that_is_not_configured_can_be_mapped(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), resolution_m=1)
    save_labels(tmp_path / "labels.png", np.zeros((2, 2), np.int16), ("hall",))
    with pytest.raises(LabelError, match="map it to one of them with 'classes'"):
        load_labels(tmp_path / "labels.png", ("corridor",), grid=grid)
    classes = {"hall": "corridor"}
    mapped = load_labels(tmp_path / "labels.png", ("corridor",), grid=grid, classes=classes)
    assert not mapped.any()
