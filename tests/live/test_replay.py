"""A log replayed gives what the same scans and maps gave live, and a map seen by position."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import LogError, MapError
from pgm_places.io.logs.bags import MapMessage, grid_of_message, read_map_messages
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.label import label_map
from pgm_places.live.live_map import LiveLabels, LiveMap
from pgm_places.live.live_options import LiveOptions
from pgm_places.live.place_finder import FoundPlace, MapFrame, MapView, PlaceFinder
from pgm_places.live.replay import Replay
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.persistence.stored import save
from pgm_places.trajectories.scan import Scan
from pgm_places.trajectories.trajectory import Trajectory
from tests.cli.conftest import Run, run
from tests.drives import building, drive
from tests.io.logs.bag_files import BagFile
from tests.quick_labeler import places

__all__ = ["run"]


def replay(path: Trajectory, maps: list[MapMessage], **options: float) -> Replay:
    chosen = LiveOptions(**options)
    finder = PlaceFinder(TrajectoryLabeler.from_places(places()), chosen)
    return Replay(path, finder, LiveMap(places()), chosen, maps)


def half(grid: OccupancyGrid) -> OccupancyGrid:
    cells = grid.cells.copy()
    cells[:, grid.shape[1] // 2 :] = UNKNOWN
    return grid.with_cells(cells)


def test_a_map_that_stays_counts_as_it_does_for_whole_drives() -> None:
    grid, path = building()[0].grid, drive(1)[:40]
    found = list(replay(path, [MapMessage(path.times_s[0], "map", grid)]))
    [labelled] = [item for item in found if isinstance(item, LiveLabels)]
    steps = [item for item in found if isinstance(item, FoundPlace)]
    prior = MapPrior.of_places(label_map(places(), grid))
    alone = TrajectoryLabeler.from_places(places()).label(path, map_prior=prior)
    assert alone.beliefs is not None
    names = places().label_names_
    beliefs = [[step.beliefs[name] for name in names] for step in steps]
    np.testing.assert_allclose(beliefs, alone.beliefs, rtol=0, atol=1e-12)
    assert [names.index(step.label) for step in steps] == alone.labels.tolist()
    for step in steps:
        region = labelled.topology.region_at(*step.pose[:2])
        assert step.region == (None if region is None else (region.id, region.name, region.label))
        assert step.map_seq == 1


def test_each_scan_sees_the_maps_that_were_sent_before_it() -> None:
    grid, path = building()[0].grid, drive(1)[:30]
    times = path.times_s[[10, 20, 21]].tolist()
    sent = [MapMessage(t, "map", g) for t, g in zip(times, (half(grid), grid, grid), strict=True)]
    found = list(replay(path, sent, relabel_min_period_s=1.0))
    seen = [item.map_seq for item in found if isinstance(item, FoundPlace)]
    # The third map comes too soon after the second: it is labelled a second later.
    assert seen == [0] * 10 + [1] * 10 + [2] * 5 + [3] * 5
    first, second, *_ = [item for item in found if isinstance(item, LiveLabels)]
    assert len(second.topology.regions) > len(first.topology.regions)


def test_without_maps_one_is_drawn_that_grows() -> None:
    found = list(replay(drive(1)[:60], [], relabel_min_period_s=4.0))
    maps = [item.topology.grid for item in found if isinstance(item, LiveLabels)]
    assert len(maps) >= 3
    assert maps[-1].free.sum() > maps[0].free.sum()
    assert maps[-1].origin_xy_m <= maps[0].origin_xy_m


def test_where_stamps_tell_no_time_metres_count(tmp_path: Path, run: Run) -> None:
    path = drive(1)[:60]
    metres = np.append(0.0, np.cumsum(path.step_lengths_m))
    by_metres = list(replay(replace(path, times_s=metres), [], relabel_min_period_s=2.0))
    two_stamps = replace(path, times_s=np.where(np.arange(60) % 20 == 0, 976052857.0, 0.0))
    found = list(replay(two_stamps, [], relabel_min_period_s=2.0))
    assert [type(item) for item in found] == [type(item) for item in by_metres]
    assert sum(isinstance(item, LiveLabels) for item in found) > 3
    for one, other in zip(found, by_metres, strict=True):
        if isinstance(one, FoundPlace) and isinstance(other, FoundPlace):
            assert (one.label, one.changed) == (other.label, other.changed)
    seconds = [item.time_s for item in found if isinstance(item, FoundPlace)]
    assert seconds == two_stamps.times_s.tolist()

    save(places(), tmp_path / "model")
    log = write_trajectory(tmp_path / "drive.log", two_stamps)
    code, text, error = run("live", "--replay", log, "--model", tmp_path / "model", "-q")
    assert code == 0
    assert text.count("map ") > 2
    assert "the 60 scans have only 2 distinct time stamps" in error


def test_stamps_that_are_rounded_to_seconds_tell_time() -> None:
    path = drive(1)[:60]
    rounded = replace(path, times_s=np.floor(path.times_s))
    assert not replay(rounded, []).counts_metres
    assert replay(replace(path, times_s=np.zeros(60)), []).counts_metres
    assert not replay(replace(path, times_s=np.zeros(60))[:1], []).counts_metres


@pytest.mark.parametrize("yaw_rad", [0.0, 0.6])
def test_a_view_says_what_the_map_says_also_from_its_files(tmp_path: Path, yaw_rad: float) -> None:
    plain = building()[0].grid
    grid = OccupancyGrid(plain.cells, plain.resolution_m, (-3.0, 2.5), yaw_rad)
    labelled = LiveMap(places()).on_map(grid)
    view, prior = MapView.of(labelled), MapPrior.of_places(labelled.labels)
    view.write(tmp_path)
    again = MapView.open(tmp_path)
    rng = np.random.default_rng(1)
    cells = rng.uniform(-5, max(grid.shape) + 5, (200, 2))
    positions = grid.cell_centres_m(cells)
    for asked in (view, again):
        np.testing.assert_array_equal(asked.at(positions), prior.at(positions))
        found = asked.log_likelihood(asked.at(positions))
        np.testing.assert_array_equal(found, prior.log_likelihood(prior.at(positions)))
        for x, y in positions.tolist():
            region = labelled.topology.region_at(x, y)
            place = asked.place_at(x, y)
            assert (place and place.id) == (region and region.id)
            [[row, column]] = grid.cells_at_m([[x, y]]).tolist()
            inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
            assert asked.contains(x, y) == inside
    assert MapFrame.of(grid).cell_at(float("nan"), 0.0) is None


def test_a_place_has_changed_once_it_has_lasted() -> None:
    grid, path = building()[0].grid, drive(1)
    live = LiveMap(places())
    view = MapView.of(live.on_map(grid))
    finder = PlaceFinder(TrajectoryLabeler.from_places(places()), LiveOptions(hysteresis_s=0.5))
    finder.use(view)
    assert path.ranges_m is not None and path.geometry is not None
    two = [item for item in live.current.topology.regions if item.label == "room"][:2]  # type: ignore[union-attr]
    first, second = (np.array([*item.anchor_m, 0.0]) for item in two)
    # There, a glance into the other place, back, and over for good.
    stays = [first] * 3 + [second] * 3 + [first] * 3 + [second] * 8
    changed = []
    for step, pose in enumerate(stays):
        scan = Scan(0.2 * step, pose, path.ranges_m[0], path.geometry)
        found = finder.step(scan)
        if found.changed:
            changed.append((step, found.region and found.region.id))
    assert changed == [(0, two[0].id), (12, two[1].id)]


def test_an_improbable_label_does_not_replace_the_one_before() -> None:
    path = drive(1)[:60]
    found = list(replay(path, [], relabel_min_period_s=1e9, min_probability=1.0))
    steps = [item for item in found if isinstance(item, FoundPlace)]
    sure = [step for step in steps if max(step.beliefs.values()) == 1.0]
    labels = {step.label for step in steps}
    assert labels <= {steps[0].label, *(step.label for step in sure)}


def test_a_bag_with_maps_is_replayed_by_the_command(tmp_path: Path, run: Run) -> None:
    path, grid = drive(1)[:30], building()[0].grid
    save(places(), tmp_path / "model")
    bag = BagFile()
    bag.drive(path)
    bag.map(0.1, half(grid))
    bag.map(4.1, grid)
    bag.entries.sort(key=lambda entry: entry[2])
    log, out = bag.write(tmp_path), tmp_path / "out"
    arguments = ("live", "--replay", log, "--model", tmp_path / "model", "-q")
    options = ("--relabel-min-period", 1)
    code, text, _ = run(*arguments, *options, "--out", out)
    assert code == 0
    lines = text.splitlines()
    assert lines[1].startswith("map 1: ")
    assert any(line.startswith("map 2: ") for line in lines)
    assert not any(": 1 places" in line for line in lines)
    rows = [json.loads(line) for line in (out / "places.jsonl").read_text().splitlines()]
    assert len(rows) == len(path)
    assert {row["map_seq"] for row in rows} == {0, 1, 2}
    assert (out / "places.json").exists()
    assert lines[-2:] == ["Next:", f"  open {out / 'index.html'} in a browser"]
    code, text, _ = run(*arguments, *options, "--jsonl", "--out", tmp_path / "again")
    assert code == 0
    records = [json.loads(line) for line in text.splitlines()]
    changes = [row for row in records if "label" in row]
    assert changes and all(row in rows for row in changes)


def test_bad_requests_are_one_line(tmp_path: Path, run: Run) -> None:
    bag = BagFile()
    bag.drive(drive(1)[:3])
    grid = building()[0].grid
    bag.map(0.0, grid, "/a")
    bag.map(0.0, grid, "/b")
    log = bag.write(tmp_path)
    (tmp_path / "other").write_text("a note")
    for words, message in [
        ((), "pass --replay LOG, or --dds"),
        (("--replay", log), "no maps on /map; topics of OccupancyGrid: /a, /b"),
        (("--replay", log, "--map-topic", "/c"), "no maps on /c; topics of OccupancyGrid: /a, /b"),
        (("--replay", tmp_path / "none.bag"), "no such file"),
        (("--replay", log, "--hysteresis", -1), "--hysteresis must be"),
        (("--replay", log, "--peer", "robot"), "--peer is for a robot: pass --dds with it"),
        (("--replay", log, "--interface", "lo"), "--interface is for a robot"),
        (("--dds", "--local", "--peer", "robot"), "--local and --peer exclude each other"),
        (("--replay", log, "--session", tmp_path / "other"), "not a JSON file"),
    ]:
        code, _, error = run("live", *words)
        assert code == 2, message
        assert message in error
        assert len(error.strip().splitlines()) == 1
    poses = Trajectory(np.zeros(1), np.zeros((1, 3)), name="poses")
    with pytest.raises(LogError, match="poses has no scans to replay"):
        replay(poses, [])


def test_maps_of_messages(tmp_path: Path) -> None:
    cells = np.array([[0, 100, -1], [0, 0, 100]], np.int8)
    sent = OccupancyGrid(cells, 0.05, (1.5, -2.0), 0.3)
    bag = BagFile()
    bag.map(7.5, sent)
    [found] = read_map_messages(bag.write(tmp_path))
    assert (found.time_s, found.frame) == (7.5, "map")
    assert found.grid.resolution_m == 0.05
    assert found.grid.origin_xy_m == sent.origin_xy_m
    assert found.grid.yaw_rad == pytest.approx(0.3, abs=1e-12)
    np.testing.assert_array_equal(found.grid.cells, cells)
    [(*_, message)] = bag.entries
    message.data = np.array([0, 25, 26, 64, 65, 99], np.int8)
    wanted = [FREE, FREE, UNKNOWN, UNKNOWN, OCCUPIED, OCCUPIED]
    assert grid_of_message(message).cells.ravel().tolist() == wanted
    message.data = np.zeros(5, np.int8)
    with pytest.raises(MapError, match="the map states 3 x 2 cells, but has 5"):
        grid_of_message(message)
    assert list(read_map_messages(tmp_path / "drive.log")) == []
