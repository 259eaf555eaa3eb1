"""Places that are written into a folder follow their rules and what stood there before."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import OutputError
from pgm_places.io.output_set import output_set
from pgm_places.io.places.topology_files import load_topology
from pgm_places.labelers.labelled_places import LabelledCells
from pgm_places.labelling.files import write_labels, write_places
from pgm_places.progress import Silent, reporting_to
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap
from tests.topology.floors import NAMES, floor_grid, floor_labels


def written(folder: Path, labels: np.ndarray, rules: TopologyOptions) -> TopologicalMap:
    with output_set(folder, "test", force=True) as files:
        cells = LabelledCells(floor_grid(labels), labels, NAMES)
        return write_places(files, "a floor", cells, rules)


def test_places_follow_their_rules(tmp_path: Path) -> None:
    labels = floor_labels()
    labels[5, 3] = 0  # a speck
    found = written(tmp_path / "out", labels, TopologyOptions())
    assert len(found.connections) == 6 and len(found.corrections) == 1
    strict = TopologyOptions(min_width_m=100.0, correct=False)
    found = written(tmp_path / "strict", labels, strict)
    assert (found.connections, found.corrections) == ((), ())


def test_places_keep_the_ids_that_they_had_in_the_folder_and_the_users_names(
    tmp_path: Path,
) -> None:
    labels = floor_labels()
    written(tmp_path / "out", labels, TopologyOptions())
    (tmp_path / "out" / "place_names.yaml").write_text("3: kitchen\n")
    labels[5:10, 1:8] = labels[4, 3:6] = -1  # the first room is gone
    found = written(tmp_path / "out", labels, TopologyOptions())
    assert [place.id for place in found.regions] == [
        2,
        3,
        4,
        6,
        7,
    ]  # doorways come after all others
    assert found.place(3).name == "kitchen"
    assert found.next_id == 8


@pytest.mark.parametrize("text", ["{", '{"format": "pgm-places topological map", "schema": 0}'])
def test_damaged_places_of_an_earlier_run_are_warned_of_and_numbered_anew(
    text: str, tmp_path: Path
) -> None:
    labels, heard = floor_labels(), Heard()
    found = written(tmp_path / "out", labels, TopologyOptions())
    (tmp_path / "out" / "places.json").write_text(text)
    with reporting_to(heard):
        again = written(tmp_path / "out", labels, TopologyOptions())
    assert [place.name for place in again.regions] == [place.name for place in found.regions]
    [warning] = heard.warnings
    assert "places.json" in warning and warning.endswith("; places get new ids")
    ids = [place.id for place in load_topology(tmp_path / "out").regions]
    assert ids == [place.id for place in again.regions]


class Heard(Silent):
    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warn(self, message: str) -> None:
        self.warnings.append(message)


@pytest.mark.parametrize("name", ["a/b", "a\\b", ".room"])
def test_a_label_that_is_no_part_of_a_file_name_is_refused_before_anything_is_written(
    name: str, tmp_path: Path
) -> None:
    result: Any = SimpleNamespace(label_names=("room", name))
    source: Any = None
    with pytest.raises(OutputError, match="cannot be part of a file name; rename it"):
        write_labels(result, source, tmp_path)
    assert not list(tmp_path.iterdir())


def test_an_edited_origin_and_another_map_are_said_in_a_line(tmp_path: Path) -> None:
    def places(origin_xy_m: tuple[float, float], labels: np.ndarray) -> tuple[list[int], list[str]]:
        heard = Heard()
        grid = floor_grid(labels, origin_xy_m=origin_xy_m)
        with reporting_to(heard), output_set(tmp_path / "out", "test", force=True) as files:
            found = write_places(
                files, "a floor", LabelledCells(grid, labels, NAMES), TopologyOptions()
            )
        return [place.id for place in found.regions], heard.warnings

    first, silent = places((0.0, 0.0), floor_labels())
    assert not silent
    again, [said] = places((50.0, -7.0), floor_labels())
    assert again == first
    assert "(0, 0) m" in said and "(50, -7) m" in said and "they keep their ids" in said
    assert places((50.0, -7.0), floor_labels()) == (first, [])
    other = np.full((4, 9), -1, np.int16)
    other[1:3, 1:8] = 1
    new, [said] = places((0.0, 0.0), other)
    assert min(new) > max(first)
    assert "those of another map" in said
