"""``doctor`` with maps: one in detail, many in a table, and corrected descriptions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pgm_places.cli import doctor_maps
from pgm_places.cli.terminal import make_progress
from pgm_places.cli.track_log import map_of
from pgm_places.cli.track_options import TrackOptions
from pgm_places.io.maps.map_server import load_map
from tests.cli.conftest import Run
from tests.io.files import write_map


def a_room() -> np.ndarray:
    pixels = np.full((40, 60), 205, np.uint8)
    pixels[5:35, 5:55] = 0
    pixels[7:33, 7:53] = 254
    return pixels


def write(folder: Path, **keys: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return write_map(folder, a_room(), **keys)


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that labels ten thousand cells a second."""
    monkeypatch.setattr(doctor_maps, "seconds_per_cell", lambda _: 1e-4)


def test_one_map_is_described_with_the_cells_to_label(tmp_path: Path, run: Run) -> None:
    code, text, _ = run("doctor", write(tmp_path, resolution="0.1", origin="[0, 0, 0.5]"))
    assert code == 0
    assert text.splitlines()[2:8] == [
        "origin (0.0, 0.0), yaw 0.5 rad",
        "map: 49.8 % free, 12.7 % occupied, 37.5 % unknown",
        "4,784 cells of 0.05 m to label",
        "note: the map is rotated by 28.65 degrees about its origin: positions of places are in "
        "the map frame, rasters are aligned with the image; Nav2's costmaps ignore the rotation",
        "warning: resampled from 0.1 m to 0.05 m cells for the model (4,784 free cells); each cell "
        "gets the most frequent label of its parts",
    ]
    assert "no problems found" not in text
    _, text, _ = run("doctor", write(tmp_path / "as the model's", resolution="0.05"))
    assert text.endswith("no problems found\n")
    _, installed, _ = run("doctor")
    assert "scikit-learn" in installed and "threads: " in installed


def test_an_image_beside_its_description_is_corrected(tmp_path: Path, run: Run) -> None:
    path = write(tmp_path)
    path.write_text(path.read_text().replace("image: map.png", "image: /home/robot/map.png"))
    code, text, _ = run("doctor", path, "--fix")
    assert code == 0
    assert text.startswith(f"corrected {path}: image map.png; original saved as map.yaml.orig")
    assert text.endswith("no problems found\n")


def test_a_threshold_that_calls_unknown_free_is_said_and_corrected_where_asked(
    tmp_path: Path, run: Run
) -> None:
    path = write(tmp_path, free_thresh="0.25")
    before = path.read_text()
    code, text, _ = run("doctor", path)
    assert code == 0
    assert "warning: 37.5 % of the pixels have grey 205" in text
    assert "'pgm-places doctor map.yaml --fix' corrects the file" in text
    assert path.read_text() == before
    code, text, _ = run("doctor", path, "--unknown-value", "none", "--fix")
    assert code == 0
    assert "map: 87.3 % free, 12.7 % occupied, 0.0 % unknown" in text
    assert path.read_text() == before
    code, text, _ = run("doctor", path, "--fix")
    assert code == 0
    assert f"corrected {path}: free_thresh 0.196; original saved as map.yaml.orig" in text
    assert text.endswith("\nno problems found\n")
    assert (tmp_path / "map.yaml.orig").read_text() == before
    assert path.read_text() == before.replace("0.25", "0.196")
    code, text, _ = run("doctor", path, "--fix")  # there is nothing left to correct
    assert code == 0
    assert "corrected" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("map.yaml", "--unknown-value", "256"), "--unknown-value must be a whole number from 0 "),
        (("map.yaml", "--unknown-value", "any"), "to 255 or 'none', got "),
        (("none.yaml",), "no such file"),
        (("--fix",), "--fix needs maps; name one, or a folder"),
    ],
)
def test_what_is_refused(
    arguments: tuple[str, ...], message: str, tmp_path: Path, run: Run, monkeypatch: Any
) -> None:
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    code, text, error = run("doctor", *arguments)
    assert (code, text) == (2, "")
    assert message in error


@pytest.mark.usefixtures("measured")
def test_a_folder_of_maps_is_a_table(tmp_path: Path, run: Run) -> None:
    write(tmp_path / "fine")
    write(tmp_path / "fine" / "coarse", resolution="0.5")
    code, text, _ = run("doctor", tmp_path)
    assert code == 0
    table = text[text.index("map  ") :].splitlines()
    # 15,000 + 0.05 x 2,400 + 1,196 cells, and as many with 119,600
    assert [line.split() for line in table[2:4]] == [
        ["fine/coarse/map", "0.5", "299.0", "119,600", "13", "s", "1"],
        ["fine/map", "0.05", "3.0", "1,196", "2", "s", "-"],
    ]
    assert table[5] == (
        "2 of 2 maps can be labelled: 120,796 cells in about 15 s of processor time"
    )
    assert table[6].startswith(
        "(estimated for one thread from a generated floor, with labels, places and files: "
    )
    assert "100 µs per cell" in table[6]
    assert table[7].startswith("fine/coarse/map: resampled from 0.5 m to 0.05")
    assert len(table) == 8


@pytest.mark.usefixtures("measured")
def test_maps_that_cannot_be_labelled_are_rows_too(tmp_path: Path, run: Run) -> None:
    write(tmp_path / "good", free_thresh="0.25")
    write(tmp_path / "gone")
    (tmp_path / "gone" / "map.png").unlink()
    full = write(tmp_path / "full")
    Image.fromarray(np.zeros((40, 60), np.uint8)).save(full.with_name("map.png"))
    huge = write(tmp_path / "huge", resolution="50")
    kept = write(tmp_path / "kept", free_thresh="0.25")
    kept.with_name("map.yaml.orig").write_text("mine")
    code, text, _ = run("doctor", tmp_path / "*" / "map.yaml", "--fix")
    assert code == 3
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line}
    assert rows["gone/map"] == ["-", "-", "-", "-", "1"]
    assert rows["full/map"] == ["0.05", "0.0", "-", "-", "2"]
    assert rows["huge/map"][2:] == ["-", "-", "1"]
    assert rows["good/map"][2:] == ["1,196", "2", "s", "-"]
    assert f"gone/map: {tmp_path / 'gone' / 'map.yaml'}: its image 'map.png' is missing" in text
    assert "huge/map: the map has cells of 50 m, which show neither walls nor doorways" in text
    assert rows["kept/map"][2:] == ["1,196", "2", "s", "2"]
    assert f"kept/map: {kept}.orig exists and would be lost; move it away first" in text
    assert "2 of 5 maps can be labelled: 2,392 cells in about 3 s" in text
    assert kept.with_name("map.yaml.orig").read_text() == "mine"
    assert load_map(tmp_path / "good" / "map.yaml").warnings == ()
    assert not huge.with_name("map.yaml.orig").exists()


def test_track_reads_its_map_as_label_does_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, free_thresh="0.25")
    meant = map_of(TrackOptions(Path("-"), map_yaml=path), make_progress(quiet=True))
    assert meant is not None
    assert meant.fractions.unknown > 0.3
    assert "have grey 205" in capsys.readouterr().err
    options = TrackOptions(Path("-"), map_yaml=path, unknown_value="none")
    letter = map_of(options, make_progress(quiet=True))
    assert letter is not None
    assert letter.fractions.unknown == 0
    assert capsys.readouterr().err == ""
