"""The experiments with drives, in generated buildings of a few rooms."""

import json
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.paper import categories, front_laser, furnished_floors
from experiments.paper.run import reproduce
from experiments.paper.scored_steps import ALONE, MODES
from experiments.paper.setting import WAYS, Setting
from pgm_places.errors import ConfigError
from pgm_places.io.maps.map_server import save_map
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.trajectories.scan import ScanGeometry

SMALL = partial(generate_building, size="small")
BEAMS = {front_laser.SHOWN: front_laser.BEAMS[front_laser.SHOWN]}


def uses_in_turn(
    labels: NDArray[np.int16], label_names: Sequence[str], resolution_m: float, seed: int
) -> NDArray[np.int16]:
    """Every use occurs, however few rooms there are."""
    rooms = connected_components(np.where(labels == label_names.index("room"), labels, -1))
    found = np.where(rooms.piece >= 0, furnished_floors.OFFICE + rooms.piece % 4, -1)
    found[labels == label_names.index("corridor")] = furnished_floors.CORRIDOR
    found[labels == label_names.index("doorway")] = furnished_floors.DOORWAY
    return found.astype(np.int16)


@pytest.mark.slow
def test_every_mode_has_a_row_and_two_have_the_paper_s_figure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(furnished_floors, "generate_building", SMALL)
    monkeypatch.setattr(furnished_floors, "used_rooms", uses_in_turn)
    shown = {categories.SHOWN: furnished_floors.DETECTORS[categories.SHOWN]}
    found = categories.run(Setting(), shown)
    [table] = found.tables
    rows = [row[:3] for row in table.rows]
    modes = (ALONE, *MODES.values())
    assert rows == [(way, categories.SHOWN, mode) for way in WAYS for mode in modes]
    papers = [item.paper for item in found.findings if item.paper is not None]
    assert papers == [0.754, 0.912] * 2
    assert {item.file for item in found.pictures} == set(found.files)


@pytest.mark.slow
def test_a_front_laser_is_tried_with_what_may_be_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(front_laser, "generate_building", SMALL)
    found = front_laser.run(Setting(), BEAMS, (("A", "B"),))
    [table] = found.tables
    assert {row[1] for row in table.rows} == {"A to B"}
    assert [item.paper for item in found.findings if item.paper] == [0.844] * 2
    assert {item.file for item in found.pictures} == set(found.files)


def write_cold_floor(folder: Path, seed: int) -> None:
    """A small building in the files of a COLD sequence, with one run along its free cells."""
    building = generate_building(seed, size="small", resolution_m=0.1)
    folder.mkdir()
    save_map(building.grid, folder / "map")
    codes = {"corridor": "CR", "room": "MPO", "doorway": "DW"}
    names = ("", *building.label_names)
    strips = [
        {
            "type": "Feature",
            "properties": {"class": codes[names[labels[start] + 1]]},
            "geometry": {
                "type": "Polygon",
                "coordinates": [_strip(building.grid, row, start, end)],
            },
        }
        for row, labels in enumerate(building.labels)
        for start, end in pairwise([0, *np.flatnonzero(np.diff(labels)) + 1, len(labels)])
        if labels[start] >= 0
    ]
    text = json.dumps({"type": "FeatureCollection", "features": strips})
    (folder / "regions.geojson").write_text(text)
    path = SimulatedRobot(ScanGeometry.half_circle(4, range_max_m=5.0)).explore(
        building.grid, spacing_m=4.0, seed=seed
    )
    rows = [
        f"{t:.3f},{x:.4f},{y:.4f},CR" for t, (x, y, _) in zip(path.times_s, path.poses, strict=True)
    ]
    (folder / "trajectory_cloudy1.csv").write_text("\n".join(["t_s,x_m,y_m,label", *rows]) + "\n")


def _strip(grid: OccupancyGrid, row: int, start: int, end: int) -> list[list[float]]:
    """The outline of cells side by side, the last of them before ``end``."""
    [[left, y], [right, _]] = grid.cell_centres_m(np.array([[row, start], [row, end - 1]]))
    half = grid.resolution_m / 2
    left, right = float(left - half), float(right + half)
    low, high = float(y - half), float(y + half)
    return [[left, low], [right, low], [right, high], [left, high], [left, low]]


@pytest.mark.slow
def test_the_paper_s_floors_are_read_from_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for floor, seed in (("floor6", 1), ("floor7", 2)):
        write_cold_floor(tmp_path / f"cold_stockholm_{floor}", seed)
    monkeypatch.setattr(front_laser, "kth", partial(front_laser.kth, beams=BEAMS))
    [found] = reproduce(["7.6-kth"], tmp_path / "out", stockholm=tmp_path, n_threads=1)
    assert found.real
    [table] = found.tables
    ways = ("floor 6 to floor 7", "floor 7 to floor 6")
    assert {row[:2] for row in table.rows} == {(way, floors) for way in WAYS for floors in ways}
    papers = {item.what for item in found.findings if item.paper}
    assert papers == {f"floor 6 to floor 7, {front_laser.SHOWN}, {ALONE}"}
    accuracies = [item.accuracy for item in found.findings]
    assert min(item for item in accuracies if item is not None) > 0.5


def test_a_floor_without_a_run_is_refused(tmp_path: Path) -> None:
    for floor in ("floor6", "floor7"):
        write_cold_floor(tmp_path / f"cold_stockholm_{floor}", 1)
        (tmp_path / f"cold_stockholm_{floor}" / "trajectory_cloudy1.csv").unlink()
    with pytest.raises(ConfigError, match=r"has no run; give it at least one trajectory_\*\.csv"):
        front_laser.kth(Setting(tmp_path))
