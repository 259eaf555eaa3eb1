"""LiveNode: turns a robot's messages into places, independent of the middleware."""

import json
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from pgm_places.errors import InputError
from pgm_places.io.logs.bag_poses import FrameBuffer, Place, SoughtPose, check_place, planar
from pgm_places.io.logs.bags import ScanMessages
from pgm_places.live.health import Health
from pgm_places.live.live_options import LiveOptions, NodeOptions
from pgm_places.live.map_process import LatestMap, MapLabellingService
from pgm_places.live.place_finder import DIGITS, FoundPlace, MapView, PlaceFinder, PlaceOfMap
from pgm_places.live.ros_codec import TYPES, RosCodec
from pgm_places.sensing.map_agreement import WARN_BELOW

HEALTH_S = 1.0
"""Seconds between diagnostics."""

JUMP_S = 1.0
"""A scan is this much earlier (s) than the previous one if the clock was set back."""

JUMPED_SCANS = 3
"""Number of consecutive such scans that count as a clock reset; a single one is late."""

SILENT_S = 5.0
"""Seconds without scans after which silence is reported."""

AGAIN_S = 10.0
"""Seconds for which a complaint of one kind is not repeated."""

NO_MAP_AFTER_S = 5.0
"""Seconds of scans before a missing map is reported."""

FIT_SCANS = 100
"""Number of latest poses whose share on free cells of the map is monitored."""

MOST_WAITING = 1000
"""Most scans that wait for transforms: more than a laser sends within the tolerance."""


class LiveNode:
    """The live node of a robot without the middleware: bytes of messages in, bytes out.

    An adapter passes on received messages (:meth:`take`), calls :meth:`turn` regularly, and sends
    the published bytes. The node reads no clock: all times come from messages and calls. The
    waiting time of a scan is measured on the clock of the calls, because the stamp of a transform
    may lie in the future. ``publish`` gets a key of ``ros_codec.OUTPUTS`` and the bytes;
    ``complain`` a line for each problem, each kind at most once in ten seconds; ``on_place`` the
    place of each scan.
    """

    def __init__(
        self,
        finder: PlaceFinder,
        service: MapLabellingService,
        publish: Callable[[str, bytes], None],
        complain: Callable[[str], None],
        options: NodeOptions | None = None,
        live: LiveOptions | None = None,
        *,
        on_place: Callable[[FoundPlace], None] | None = None,
    ) -> None:
        self._finder, self._service, self._publish, self._say = finder, service, publish, complain
        self._options, self._live = options or NodeOptions(), live or LiveOptions()
        self._on_place = on_place
        self._codec, self._frames = RosCodec(), FrameBuffer()
        self._scans = ScanMessages(self._options.scan_topic)
        self._waiting: deque[tuple[float, Any]] = deque(maxlen=MOST_WAITING)
        self._on_free: deque[bool] = deque(maxlen=FIT_SCANS)
        self._last_scan_s, self._clock_s, self._n_back = -np.inf, -np.inf, 0
        self._health, self._next_health_s = Health(silent_s=SILENT_S), -np.inf
        self._first_scan_s: float | None = None
        self._map = LatestMap(self._codec, self._options.map_frame)
        self._map_is_new, self._n_skipped = False, 0
        self._submitted_s, self._now_s = -np.inf, 0.0
        self._took_map = False
        self._from_odometry: set[str] = set()

    def take(
        self, what: str, raw: bytes, *, clock_s: float | None = None, now_s: float | None = None
    ) -> None:
        """Process a received message: a scan, map, map_updates, tf, tf_static or odom, as CDR.

        ``clock_s`` is the time on the clock of the stamps, to detect late scans; ``now_s`` the time
        on the clock of :meth:`turn`, by default that of its last call.
        """
        self._now_s = self._now_s if now_s is None else max(now_s, self._now_s)
        if clock_s is not None:
            if clock_s < self._clock_s - JUMP_S:
                self._begin_anew(clock_s, self._clock_s - clock_s)
            self._clock_s = clock_s
        if what in ("map", "map_updates"):
            self._on_map(what, raw)
            return
        try:
            message = self._codec.read(raw, what)
        except InputError as error:
            self._complain(what, str(error))
            return
        if what == "scan":
            self._on_scan(message, clock_s)
        elif what == "odom":
            self._on_odom(message)
        else:
            self._on_transforms(message, clock_s, is_static=what == "tf_static")
        self._drain()

    def turn(self, now_s: float) -> None:
        """Use new results of the labelling service, and submit the latest map.

        ``now_s`` is the time of a monotonic clock.
        """
        self._now_s = now_s
        self._drain()
        if silent_s := self._silence_s():
            topic = self._options.full_name(self._options.scan_topic)
            self._complain("silent", f"no scan on {topic} for {silent_s:.0f} s")
        self._tell_health()
        answer = self._service.answer()
        if isinstance(answer, str):
            self._complain("map", answer)
        elif answer is not None:
            self._tell_of_distance(answer.view)
            self._finder.use(answer.view)
            self._health.n_maps += 1
            for what, raw in answer.messages.items():
                self._publish(what, raw)
        since = now_s - self._submitted_s
        is_due = since >= self._live.relabel_min_period_s
        if self._map_is_new and self._service.is_idle and is_due:
            self._submit(since)

    def _submit(self, since: float) -> None:
        """Submit the latest map, at the earliest some seconds after the previous one."""
        if self._n_skipped:
            self._complain(
                "slow",
                f"labelling a map took {since:.1f} s, and {self._n_skipped} that came meanwhile "
                "were skipped; the latest is labelled now",
            )
        self._map_is_new, self._n_skipped, self._submitted_s = False, 0, self._now_s
        self._service.submit(self._map.raw())

    def _tell_of_distance(self, view: MapView) -> None:
        """Report a map that does not overlap the previous one."""
        before = self._finder.view
        if before is not None and (far_m := before.frame.distance_m(view.frame)) > 0:
            self._complain(
                "elsewhere",
                f"the map lies {far_m:.0f} m from the one before, and shares no cell with it; is "
                "its origin right? Its places are new ones",
            )

    def where(self, x_m: float, y_m: float) -> PlaceOfMap | None:
        """The place of the labelled map at a position in its frame, or None."""
        view = self._finder.view
        return None if view is None else view.place_at(x_m, y_m)

    @property
    def map_seq(self) -> int:
        """Number of the labelled map in use, 0 before the first."""
        view = self._finder.view
        return 0 if view is None else view.map_seq

    def _on_map(self, what: str, raw: bytes) -> None:
        """Process a map, or an update of it."""
        self._took_map = self._took_map or what == "map"
        try:
            if what == "map":
                self._map.take(raw)
            else:
                self._map.update(raw)
        except InputError as error:
            self._complain(f"not used: {what}", str(error))
            return
        if what == "map" and self._map_is_new and not self._service.is_idle:
            self._n_skipped += 1
        self._map_is_new = True

    def _on_transforms(self, message: Any, clock_s: float | None, *, is_static: bool) -> None:
        for item in message.transforms:
            time_s = _stamp_s(item.header)
            place = planar(item.transform.translation, item.transform.rotation)
            parent, child = item.header.frame_id, item.child_frame_id
            if not self._is_place(place, parent, child):
                continue
            if clock_s is not None and clock_s < time_s and not self._frames.knows(child):
                # Stamped ahead, so that it may be used until then: it is valid already.
                self._frames.add(parent, child, clock_s, place, is_static=is_static)
            self._frames.add(parent, child, time_s, place, is_static=is_static)

    def _on_odom(self, message: Any) -> None:
        parent, child = message.header.frame_id.lstrip("/"), message.child_frame_id.lstrip("/")
        if self._frames.knows(child) and child not in self._from_odometry:
            return  # a transform is more accurate
        place = planar(message.pose.pose.position, message.pose.pose.orientation)
        if not self._is_place(place, parent, child):
            return
        self._from_odometry.add(child)
        self._frames.add(parent, child, _stamp_s(message.header), place)

    def _is_place(self, place: Place, parent: str, child: str) -> bool:
        """Whether a robot can be at a pose; reported if not."""
        try:
            check_place(place, parent, child)
        except InputError as error:
            self._complain("place", str(error))
            return False
        return True

    def _on_scan(self, message: Any, clock_s: float | None) -> None:
        time_s = _stamp_s(message.header)
        self._hear()
        if time_s < self._last_scan_s - JUMP_S:
            back_s, self._n_back = self._last_scan_s - time_s, self._n_back + 1
            if self._n_back < JUMPED_SCANS:
                self._drop("late", f"a scan from {back_s:.1f} s before the last is dropped")
                return
            self._begin_anew(time_s, back_s)
        self._n_back = 0
        if clock_s is not None and time_s - clock_s > self._options.stale_after_s:
            self._complain(
                "future",
                f"a scan is dated {time_s - clock_s:.2f} s ahead; are the clocks in step, and is "
                "use_sim_time right?",
            )
        if clock_s is not None and clock_s - time_s > self._options.stale_after_s:
            self._drop(
                "stale",
                f"a scan came {clock_s - time_s:.2f} s after its stamp and is dropped; are the "
                "clocks in step, and is use_sim_time right? (stale_after)",
            )
            return
        self._last_scan_s = max(self._last_scan_s, time_s)
        if self._first_scan_s is None:
            self._first_scan_s = time_s
        if not self._took_map and time_s - self._first_scan_s > NO_MAP_AFTER_S:
            topic = self._options.full_name(self._options.map_topic)
            self._complain("no map", f"no map on {topic} yet: places are estimated from scans only")
        self._waiting.append((self._now_s, message))

    def _hear(self) -> None:
        """Note a message of the robot; report the end of a silence."""
        if silent_s := self._silence_s():
            self._say(f"scans come again after {silent_s:.0f} s")
        self._health.heard_s = self._now_s

    def _silence_s(self) -> float:
        """Seconds for which the robot has been silent; 0 if it is not."""
        silent_s = self._now_s - self._health.heard_s
        return silent_s if SILENT_S < silent_s < np.inf else 0.0

    def _begin_anew(self, time_s: float, back_s: float) -> None:
        self._complain("clock", f"the clock went back by {back_s:.1f} s; starting over")
        self._waiting.clear()
        self._on_free.clear()
        self._frames.forget_after(time_s)
        self._finder.forget()
        self._last_scan_s, self._n_back = -np.inf, 0

    def _drain(self) -> None:
        """Label the waiting scans in order, up to the first without a transform."""
        while self._waiting:
            came_s, message = self._waiting[0]
            time_s, frame = _stamp_s(message.header), message.header.frame_id
            sought = self._frames.pose(self._options.map_frame, frame, time_s)
            waited_s = self._now_s - came_s
            if sought.pose is None and sought.may_come and waited_s <= self._options.tf_tolerance_s:
                return
            self._waiting.popleft()
            if sought.pose is None:
                self._drop("tf", f"a scan is dropped: {sought.problem} (map_frame, tf_tolerance)")
            else:
                self._label(message, time_s, sought)

    def _label(self, message: Any, time_s: float, sought: SoughtPose) -> None:
        pose = sought.pose
        assert pose is not None  # checked by the caller
        base = self._frames.pose(self._options.map_frame, self._options.base_frame, time_s)
        if base.pose is None:
            self._complain(
                "base", f"the laser stands in for the robot: {base.problem} (base_frame)"
            )
        try:
            scan = self._scans.scan(message, time_s, pose, mirrored=sought.mirrored)
        except InputError as error:
            self._drop("scan", f"a scan is dropped: {error}")
            return
        found = self._finder.step(scan, pose if base.pose is None else base.pose)
        view = self._finder.view
        if view is not None and not view.contains(*found.pose[:2]):
            x, y, _ = found.pose
            self._complain(
                "outside",
                f"the robot at ({x:.2f}, {y:.2f}) is outside the map; are map_frame and the map's "
                "origin right?",
            )
        elif view is not None:
            self._watch_fit(view, found)
        self._health.last, self._health.n_placed = found, self._health.n_placed + 1
        stamp = message.header.stamp
        self._publish("place", self._codec.text(_place_text(found, stamp), "place"))
        typed = _place_message(self._codec, found, stamp, self._options.map_frame.lstrip("/"))
        self._publish("current_place", typed)
        if self._on_place is not None:
            self._on_place(found)

    def _watch_fit(self, view: MapView, found: FoundPlace) -> None:
        """Warn if the robot's latest poses are not in the map's free space."""
        self._on_free.append(view.is_labelled(*found.pose[:2]))
        share = sum(self._on_free) / FIT_SCANS
        if len(self._on_free) == FIT_SCANS and share < WARN_BELOW:
            self._complain(
                "fit",
                f"{100 * share:.0f} % of the last {FIT_SCANS} scans were taken in free space of "
                "the map; check the localisation and the map_frame",
            )

    def _complain(self, kind: str, text: str) -> None:
        """Report a problem, unless its kind was reported within the last seconds."""
        before, _ = self._health.reports.get(kind, (-np.inf, ""))
        if self._now_s - before >= AGAIN_S:
            self._health.reports[kind] = (self._now_s, text)
            self._say(text)

    def _drop(self, kind: str, text: str) -> None:
        """Drop a scan, and report the reason."""
        self._health.n_dropped += 1
        self._complain(kind, text)

    def _tell_health(self) -> None:
        if self._now_s >= self._next_health_s:
            self._next_health_s = self._now_s + HEALTH_S
            name = f"{self._options.output_namespace.strip('/')}: places"
            clock_s = self._clock_s if np.isfinite(self._clock_s) else 0.0
            status = self._health.status(self._codec, name, self._now_s, clock_s)
            self._publish("diagnostics", status)


def _stamp_s(header: Any) -> float:
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def _place_message(codec: RosCodec, found: FoundPlace, stamp: object, frame: str) -> bytes:
    """The place as a ``pgm_places_msgs/Place``."""
    region, types = found.region, codec.store.types
    message = types[TYPES["current_place"]](
        types["std_msgs/msg/Header"](stamp, frame),
        found.label,
        found.probability,
        list(found.beliefs),
        np.array(list(found.beliefs.values()), np.float64),
        0 if region is None else region.id,
        "" if region is None else region.name,
        found.map_seq,
        found.changed,
        *found.pose,
    )
    return codec.write(message, "current_place")


def _place_text(found: FoundPlace, stamp: Any) -> str:
    region = found.region
    record = {
        "stamp": {"sec": int(stamp.sec), "nanosec": int(stamp.nanosec)},
        "label": found.label,
        "p": round(found.probability, DIGITS),
        "beliefs": {name: round(value, DIGITS) for name, value in found.beliefs.items()},
        "region": None if region is None else region.id,
        "name": None if region is None else region.name,
        "map_seq": found.map_seq,
        "changed": found.changed,
        "pose": [round(value, DIGITS) for value in found.pose],
    }
    return json.dumps(record, ensure_ascii=False)
