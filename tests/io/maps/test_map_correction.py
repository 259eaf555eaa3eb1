"""Corrected descriptions: one number changes, and the file as it was is kept."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import MapError, OutputError
from pgm_places.io.maps.map_server import correct_map, load_map
from tests.io.files import write_map

PIXELS = np.array([[254, 205, 0]], np.uint8)


@pytest.mark.parametrize(
    ("line", "corrected"),
    [
        (b"free_thresh: 0.25\n", b"free_thresh: 0.196\n"),
        (b"free_thresh:   2.5e-1  # Humble\r\n", b"free_thresh:   0.196  # Humble\r\n"),
        (b"free_thresh : 0.25", b"free_thresh : 0.196"),
    ],
)
def test_only_the_threshold_changes_and_the_old_file_is_kept(
    tmp_path: Path, line: bytes, corrected: bytes
) -> None:
    path = write_map(tmp_path, PIXELS, free_thresh=None)
    before = b"# my map: free_thresh: 0.25\n" + path.read_bytes() + line
    path.write_bytes(before)
    kept = correct_map(path, {"free_thresh": 0.196})
    assert kept == tmp_path / "map.yaml.orig"
    assert kept.read_bytes() == before
    assert path.read_bytes() == before[: -len(line)] + corrected
    found = load_map(path)
    assert found.grid.cells.tolist() == [[0, -1, 100]]
    assert found.warnings == ()


def test_an_earlier_file_is_not_lost(tmp_path: Path) -> None:
    path = write_map(tmp_path, PIXELS, free_thresh="0.25")
    (tmp_path / "map.yaml.orig").write_text("mine")
    before = path.read_bytes()
    with pytest.raises(OutputError, match=r"map\.yaml\.orig exists and would be lost; move it"):
        correct_map(path, {"free_thresh": 0.196})
    assert path.read_bytes() == before
    assert (tmp_path / "map.yaml.orig").read_text() == "mine"


@pytest.mark.parametrize(
    "text",
    [
        "{image: map.png, free_thresh: 0.25}\n",
        'image: map.png\n"free_thresh": 0.25\n',
        'image: map.png\nfree_thresh: "0.25"\n',
        "image: map.png\nfree_thresh:\n  0.25\n",
    ],
)
def test_what_cannot_be_changed_in_place_is_left_alone(tmp_path: Path, text: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(MapError, match=r"does not have its own line; set free_thresh: 0\.196 by"):
        correct_map(path, {"free_thresh": 0.196})
    assert path.read_text() == text
    assert [file.name for file in tmp_path.iterdir()] == ["map.yaml"]
