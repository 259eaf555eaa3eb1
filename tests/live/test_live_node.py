"""The core of a node: messages in any order and of any quality, places out, plain words."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pgm_places.io.logs.bags import ScanMessages
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_map import LiveMap
from pgm_places.live.live_node import FIT_SCANS, LiveNode
from pgm_places.live.live_options import LiveOptions, NodeOptions
from pgm_places.live.place_finder import MapView, PlaceFinder
from pgm_places.live.ros_codec import RosCodec
from pgm_places.maps.occupancy_grid import OccupancyGrid
from tests.drives import building, drive
from tests.io.logs.bag_files import BagFile
from tests.live.robot import Service, driven, raw_map, raw_messages, text_of
from tests.live.test_latest_map import update
from tests.quick_labeler import places


class Robot:
    """A node whose every message and complaint is kept."""

    def __init__(self, options: NodeOptions | None = None, **live: float) -> None:
        self.sent: list[tuple[str, bytes]] = []
        self.said: list[str] = []
        self.service = Service()
        chosen = LiveOptions(**live)
        self.finder = PlaceFinder(TrajectoryLabeler.from_places(places()), chosen)
        self.node = LiveNode(
            self.finder,
            self.service,
            lambda what, raw: self.sent.append((what, raw)),
            self.said.append,
            options or NodeOptions(base_frame="laser"),
            chosen,
        )

    def take(self, messages: list[tuple[str, bytes]], **clock: float) -> None:
        for what, raw in messages:
            self.node.take(what, raw, **clock)

    def places(self) -> list[dict[str, Any]]:
        return [text_of(raw) for what, raw in self.sent if what == "place"]


def test_scans_get_the_places_that_the_finder_gives() -> None:
    path, grid, robot = drive(1)[:12], building()[0].grid, Robot()
    robot.node.take("map", raw_map(grid))
    robot.node.turn(0.0)
    robot.node.turn(0.1)
    robot.take(driven(path))
    alone = PlaceFinder(TrajectoryLabeler.from_places(places()))
    alone.use(MapView.of(LiveMap(places()).on_map(grid)))
    found, codec, made = robot.places(), RosCodec(), ScanMessages("scan")
    assert len(found) == len(path)
    raws = [raw for what, raw in driven(path) if what == "scan"]
    for pose, raw, row in zip(path.poses, raws, found, strict=True):
        message = codec.read(raw, "scan")  # whose angles are of single precision
        time_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        scan = made.scan(message, time_s, pose)
        wanted = alone.step(scan)
        assert (row["label"], row["map_seq"], row["changed"]) == (wanted.label, 1, wanted.changed)
        assert row["region"] == (wanted.region and wanted.region.id)
        assert row["name"] == (wanted.region and wanted.region.name)
        assert row["beliefs"] == pytest.approx(wanted.beliefs, abs=1e-5)
        assert row["stamp"]["sec"] + 1e-9 * row["stamp"]["nanosec"] == pytest.approx(scan.time_s)
    assert robot.said == []


def test_what_is_published_of_a_map() -> None:
    plain = building()[0].grid
    grid = OccupancyGrid(plain.cells, 0.1, (-2.0, 3.0), 0.5)
    robot, codec = Robot(), RosCodec()
    robot.node.take("map", raw_map(grid))
    robot.node.turn(0.0)
    robot.node.turn(0.1)
    sent = dict(robot.sent)
    assert set(sent) == {"label_map", "markers", "topology", "places", "diagnostics"}
    labels = codec.read(sent["label_map"], "label_map")
    came = codec.read(raw_map(grid), "map")
    assert labels.info == came.info and labels.header == came.header
    raster = labels.data.reshape(grid.shape)
    assert ((raster >= 1) == (raster != -1)).all()
    assert (raster[~grid.free] == -1).all()
    markers = codec.read(sent["markers"], "markers").markers
    assert (markers[0].action, len({(m.ns, m.id) for m in markers})) == (3, len(markers))
    assert all(m.header.frame_id == "map" for m in markers)
    topology = text_of(sent["topology"])
    assert topology["map_seq"] == 1
    ids = {place["id"] for place in topology["places"]}
    assert ids == set(topology["appeared"]) == {m.id for m in markers if m.ns == "names"}
    assert {end for item in topology["connections"] for end in (item["a"], item["b"])} <= ids
    typed = codec.read(sent["places"], "places")
    assert typed.header == came.header
    assert (typed.map_seq, typed.appeared.tolist()) == (1, topology["appeared"])
    for region, place in zip(typed.regions, topology["places"], strict=True):
        assert (region.id, region.name, region.label) == (
            *(place["id"], place["name"], place["label"]),
        )
        assert (region.anchor.x, region.anchor.y) == (place["x_m"], place["y_m"])
        assert region.confidence == place["confidence"]
    assert {(item.first, item.second) for item in typed.connections} == {
        (item["a"], item["b"]) for item in topology["connections"]
    }


def test_a_scan_waits_for_its_transform_and_is_dropped_when_none_comes() -> None:
    messages = driven(drive(1)[:8])
    transforms, scans = messages[0::2], messages[1::2]
    robot = Robot(NodeOptions(base_frame="laser", tf_tolerance_s=0.5))
    robot.take([transforms[0], scans[0], scans[1]], now_s=10.0)
    assert len(robot.places()) == 1
    robot.take([transforms[1]], now_s=10.4)
    assert len(robot.places()) == 2
    assert robot.said == []
    robot.take(scans[2:4], now_s=11.0)
    robot.node.turn(11.4)
    robot.take(scans[4:6], now_s=11.45)
    robot.node.turn(11.5)
    assert robot.said == []
    robot.node.turn(11.6)  # 0.6 s without a transform
    [line] = robot.said
    assert line.startswith("a scan is dropped: the transform from map to laser is 0.20 s older")
    assert len(robot.places()) == 2
    robot.take(transforms[2:8], now_s=11.6)  # they come late: what still waits is labelled
    assert len(robot.places()) == 4


def test_odometry_stands_in_where_no_transform_says_how_the_robot_moves() -> None:
    bag = BagFile()
    bag.transform(0.0, "map", "odom", 1.0, topic="/tf_static")
    bag.transform(0.0, "base_link", "laser", 0.5, topic="/tf_static")
    bag.odometry(0.0, 2.0)
    bag.odometry(1.0, 4.0)
    bag.scan(0.5, [1.0, 1.0, 1.0])
    robot = Robot(NodeOptions())
    robot.take(list(raw_messages(bag)))
    [place] = robot.places()
    assert place["pose"] == [4.0, 0.0, 0.0]
    with_transforms = BagFile()
    with_transforms.transform(0.0, "odom", "base_link", 20.0)
    with_transforms.odometry(0.0, 2.0)
    with_transforms.scan(0.0, [1.0, 1.0, 1.0])
    robot = Robot(NodeOptions(map_frame="odom", base_frame="base_link"))
    robot.take([*raw_messages(bag)][1:2] + list(raw_messages(with_transforms)))
    assert robot.places()[0]["pose"] == [20.0, 0.0, 0.0]


def test_the_typed_place_says_what_the_text_says() -> None:
    path, robot, codec = drive(1)[:4], Robot(), RosCodec()
    robot.node.take("map", raw_map(building()[0].grid))
    robot.node.turn(0.0)
    robot.node.turn(0.1)
    robot.take(driven(path))
    typed = [codec.read(raw, "current_place") for what, raw in robot.sent if what[0] == "c"]
    for row, place in zip(robot.places(), typed, strict=True):
        assert (place.header.stamp.sec, place.header.frame_id) == (row["stamp"]["sec"], "map")
        assert dict(zip(place.labels, place.beliefs, strict=True)) == pytest.approx(
            row["beliefs"], abs=1e-6
        )
        assert (place.label, place.probability) == (row["label"], pytest.approx(row["p"], abs=1e-6))
        assert (place.id or None, place.name or None) == (row["region"], row["name"])
        assert [place.x, place.y, place.heading] == pytest.approx(row["pose"], abs=1e-6)
        assert (place.map_seq, place.changed) == (1, row["changed"])
        found = robot.node.where(place.x, place.y)
        assert (found and found.id) == row["region"]
    assert robot.node.map_seq == 1


def test_diagnostics_say_what_was_wrong_lately_or_else_where_the_robot_is() -> None:
    messages, robot, codec = driven(drive(1)[:8]), Robot(), RosCodec()

    def status(now_s: float) -> Any:
        robot.node.turn(now_s)
        raw = [raw for what, raw in robot.sent if what == "diagnostics"][-1]
        [found] = codec.read(raw, "diagnostics").status
        return found

    found = status(0.0)
    assert (found.name, found.level, found.message) == (
        *("pgm_places: places", 1, "no scan has come yet"),
    )
    robot.take(messages[:6], now_s=1.0)
    found = status(1.5)
    place = robot.places()[-1]
    assert (found.level, found.message) == (0, place["name"] or place["label"])
    values = {item.key: item.value for item in found.values}
    assert (values["scans placed"], values["scans dropped"]) == ("3", "0")
    assert values["seconds since the last scan"] == "0.5"
    robot.take([messages[7]], now_s=2.0)  # a scan without its transform
    found = status(3.0)
    assert found.level == 1
    assert found.message.startswith("a scan is dropped: the transform from map to laser")
    assert {item.key: item.value for item in found.values}["scans dropped"] == "1"
    assert status(6.9).level == 1
    assert (status(8.0).level, status(8.0).message) == (2, "no scans come")
    robot.take(messages[6:], now_s=15.0)
    assert status(16.0).level == 1  # its silence was said
    robot.node.turn(30.0)


def test_a_clock_that_goes_back_begins_anew() -> None:
    messages = driven(drive(1)[:10])
    robot = Robot()
    robot.take(messages)
    robot.take(messages[:2])  # a single scan is late
    assert robot.said == ["a scan from 1.8 s before the last is dropped"]
    robot.take(messages[-2:])
    assert len(robot.places()) == 11
    robot.take(messages[:4])
    assert len(robot.said) == 1
    robot = Robot()
    robot.take(messages)
    robot.take([*messages[:4], *messages[:6]])
    assert robot.said[1:] == ["the clock went back by 1.8 s; starting over"]
    places_found = robot.places()
    assert places_found[10]["changed"]
    assert places_found[10]["beliefs"] == places_found[0]["beliefs"]


def test_a_clock_that_runs_twice_through_a_bag_is_noticed_at_once() -> None:
    messages = driven(drive(1)[:10])
    robot = Robot()
    robot.take(messages, clock_s=1.0)
    robot.take(messages[:2], clock_s=-12.0)
    assert robot.said[0] == "the clock went back by 13.0 s; starting over"
    assert len(robot.places()) == 11


def test_silence_and_its_end_are_said() -> None:
    messages = driven(drive(1)[:6])
    robot = Robot()
    robot.node.turn(0.0)
    robot.take(messages[:4], now_s=1.0)
    robot.node.turn(5.9)
    assert robot.said == []
    robot.node.turn(6.5)
    assert robot.said == ["no scan on /scan for 6 s"]
    robot.node.turn(12.0)
    assert len(robot.said) == 1
    robot.take(messages[4:6], now_s=14.0)
    assert robot.said[1:] == ["scans come again after 13 s"]


def test_maps_of_another_frame_are_refused() -> None:
    robot = Robot(NodeOptions(base_frame="laser", map_frame="/world"))
    robot.node.take("map", raw_map(building()[0].grid))
    [line] = robot.said
    assert line.startswith("the map is in the frame 'map', but positions are looked up in '/world'")
    robot.node.turn(0.0)
    assert robot.service.n_submitted == 0


ELSEWHERE = OccupancyGrid(building()[0].grid.cells, building()[0].grid.resolution_m, (500.0, 0.0))
PATH = drive(1)[:40]


@pytest.mark.parametrize(
    ("options", "messages", "late_s", "message"),
    [
        ({}, driven(PATH), None, "no map on /map yet: places are estimated from scans only"),
        ({}, driven(PATH[:3]), 60.0, "a scan came 60.00 s after its stamp and is dropped"),
        ({}, driven(PATH[:3]), -60.0, "a scan is dated 60.00 s ahead"),
        (
            *({"map_frame": "world"}, driven(PATH[:5]), None),
            "no transforms lead from 'world' to 'laser'; frames: laser, map",
        ),
        (
            *({"base_frame": "robot"}, driven(PATH[:3]), None),
            "the laser stands in for the robot: no transforms lead from 'map' to",
        ),
        ({}, [("map", raw_map(ELSEWHERE)), *driven(PATH[:2])], None, "is outside the map"),
        (
            *({}, [("scan", b"\0\1\0\0nonsense")], None),
            "a message of scan cannot be read as sensor_msgs/msg/LaserScan",
        ),
    ],
)
def test_what_is_wrong_is_said_once_in_plain_words(
    options: dict[str, Any],
    messages: list[tuple[str, bytes]],
    late_s: float | None,
    message: str,
) -> None:
    robot = Robot(NodeOptions(**{"base_frame": "laser"} | options))
    clock = {} if late_s is None else {"clock_s": float(PATH.times_s[0]) + late_s}
    robot.take(messages[:1], **clock)
    robot.node.turn(0.0)
    robot.node.turn(0.1)
    robot.take(messages[1:], **clock)
    robot.node.turn(1.0)
    [line] = [line for line in robot.said if message in line]
    if late_s != -60.0:
        assert robot.said == [line]
    assert all(place["region"] is None for place in robot.places())


def test_maps_that_cannot_be_labelled_leave_the_one_before() -> None:
    grid, robot, codec = building()[0].grid, Robot(relabel_min_period_s=0.5), RosCodec()
    broken = codec.read(raw_map(grid), "map")
    broken.data = broken.data[:-1]
    nothing = raw_map(grid.with_cells(np.full(grid.shape, -1)))
    for number, raw in enumerate(
        (raw_map(grid), codec.write(broken, "map"), nothing, b"\0\1\0\0nonsense")
    ):
        robot.node.take("map", raw)
        robot.node.turn(20.0 * number)
        robot.node.turn(20.0 * number + 0.1)
    size = grid.cells.size
    assert [line.partition(";")[0] for line in robot.said][:2] == [
        f"the map is not labelled: the map states {grid.shape[1]} x {grid.shape[0]} cells, but has "
        f"{size - 1}",
        "the map is not labelled: the map has no free cell to label",
    ]
    assert "a message of map cannot be read" in robot.said[2]
    view = robot.finder.view
    assert view is not None and view.map_seq == 1


def test_of_maps_that_come_too_fast_the_latest_is_labelled() -> None:
    grid, robot = building()[0].grid, Robot(relabel_min_period_s=2.0)
    cells = [np.where(np.arange(grid.shape[1]) < n, grid.cells, -1) for n in (40, 60, 80, 100)]
    maps = [raw_map(grid.with_cells(item)) for item in cells]
    robot.service.busy = True
    robot.node.take("map", maps[0])
    robot.node.turn(0.0)
    for number, raw in enumerate(maps[1:], 1):
        robot.node.take("map", raw)
        robot.node.turn(float(number))
    assert robot.service.n_submitted == 1
    robot.service.busy = False
    robot.node.turn(30.0)
    assert robot.service.n_submitted == 2
    assert robot.service.waiting == [maps[-1]]
    assert robot.said == [
        "labelling a map took 30.0 s, and 2 that came meanwhile were skipped; the latest is "
        "labelled now"
    ]
    robot.node.turn(31.0)
    robot.node.take("map", maps[0])
    robot.node.turn(31.5)  # too soon after the last
    assert robot.service.n_submitted == 2
    robot.node.turn(32.0)
    assert robot.service.n_submitted == 3
    assert json.loads(json.dumps([what for what, _ in robot.sent])).count("topology") == 2


def test_updates_of_the_map_are_labelled() -> None:
    grid, robot = building()[0].grid, Robot(relabel_min_period_s=1.0)
    half = grid.shape[1] // 2
    seen = grid.with_cells(np.where(np.arange(grid.shape[1]) < half, grid.cells, -1))
    robot.node.take("map", raw_map(seen))
    robot.node.turn(0.0)
    robot.node.turn(0.1)
    codec = RosCodec()
    [occupied] = {int(v) for v in codec.read(raw_map(grid), "map").data if v > 50}
    cells = np.where(grid.cells == 100, occupied, grid.cells)[:, half:]
    robot.node.take("map_updates", update(half, 0, cells))
    robot.node.turn(0.5)  # too soon
    robot.node.turn(2.0)
    robot.node.turn(2.1)
    whole = LiveMap(places())
    whole.on_map(seen)
    view = robot.finder.view
    assert view is not None
    assert view.map_seq == 2
    np.testing.assert_array_equal(view.region, MapView.of(whole.on_map(grid)).region)
    assert robot.said == []
    robot.node.take("map_updates", update(grid.shape[1], 0, [[1]]))
    assert "is no part of the map" in robot.said[0]


def test_a_robot_that_drives_through_walls_is_reported() -> None:
    path = drive(1)[: FIT_SCANS + 1]
    for shift_m in (0.0, 2.0):
        robot = Robot()
        robot.node.take("map", raw_map(building()[0].grid))
        robot.node.turn(0.0)
        robot.node.turn(0.1)
        robot.take(driven(replace(path, poses=path.poses + np.array([0.0, shift_m, 0.0]))))
        said = [line for line in robot.said if "in free space" in line]
        assert len(said) == (shift_m > 0)


def changed(raw: bytes, what: str, part: str, value: float) -> bytes:
    """A message with another number in a field such as ``transforms.0.transform.x``."""
    codec = RosCodec()
    message = item = codec.read(raw, what)
    *way, name = part.split(".")
    for step in way:
        item = item[int(step)] if step.isdigit() else getattr(item, step)
    object.__setattr__(item, name, value)
    return codec.write(message, what)


@pytest.mark.parametrize(
    ("what", "part", "value"),
    [
        *(("tf", "translation.x", value) for value in (1e308, -1.1e7, np.inf, np.nan)),
        *(("tf", "rotation.z", value) for value in (np.inf, np.nan)),
        *(("scan", "angle_increment", value) for value in (0.0, 1e-9, np.nan, np.inf, 1e9, -1.0)),
        *(("scan", "angle_min", value) for value in (np.nan, np.inf, 1e9)),
    ],
)
def test_what_leads_nowhere_is_refused_and_the_next_one_taken(
    what: str, part: str, value: float
) -> None:
    messages, robot = driven(drive(1)[:2]), Robot()
    given = {"map": raw_map(building()[0].grid)} | dict(messages[:2])
    path = f"transforms.0.transform.{part}" if what == "tf" else part
    given[what] = changed(given[what], what, path, value)
    robot.take([*given.items(), *messages[2:]])
    robot.node.turn(100.0)
    assert len(robot.places()) == 1
    if what == "tf":
        assert robot.said[0].startswith("the transform from 'map' to 'laser' is (")
        assert "must be metres and radians up to 1e+07; the transform is ignored" in robot.said[0]
    else:
        assert "a scan is dropped: scan: a scan of" in robot.said[0]
        assert "and cover at most a full circle; check the laser's driver" in robot.said[0]


@pytest.mark.parametrize("far_m", [1e3, 1e4, 1e6])
def test_a_map_that_lies_elsewhere_is_taken_and_said(far_m: float) -> None:
    grid, robot = building()[0].grid, Robot()
    small = OccupancyGrid(grid.cells[:60, :80], grid.resolution_m)
    for number, x_m in enumerate((0.0, far_m)):
        robot.node.take("map", raw_map(OccupancyGrid(small.cells, small.resolution_m, (x_m, x_m))))
        for step in range(3):
            robot.node.turn(30.0 * number + step)
    assert robot.node.map_seq == 2
    (said,) = robot.said
    assert "from the one before, and shares no cell with it; is its origin right?" in said
    assert robot.finder.view is not None
    assert robot.node.where(far_m + 3.0, far_m + 3.0) == robot.finder.view.place_at(
        far_m + 3.0, far_m + 3.0
    )
    assert robot.node.where(1e308, -1e308) is None
