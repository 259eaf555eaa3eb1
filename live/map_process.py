"""MapProcess: labels maps in a second process, so that scans never wait for them.

Python runs one thread at a time. A map of four million cells takes seconds to label, and a step
that holds the interpreter would block the scans. Maps are therefore labelled by a second process of
lower priority, which writes its results into files. The first process maps these into memory and
reads only the cells that it looks up.
"""

import contextlib
import json
import math
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from typing import IO, Any, Protocol, Self

import numpy as np

from pgm_places.errors import InputError, OutputError, PgmPlacesError
from pgm_places.io.logs.bags import grid_of_message
from pgm_places.io.places.place_bag import ROS, class_grid, place_markers
from pgm_places.io.places.place_ids_file import read_session, write_session
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import ModelOptions
from pgm_places.live.live_map import LiveLabels, LiveMap
from pgm_places.live.place_finder import MapView
from pgm_places.live.ros_codec import SHOWN, TYPES, RosCodec
from pgm_places.topology.place_ids import PlaceIds


class LatestMap:
    """Stores the last ``nav_msgs/OccupancyGrid`` and applies ``map_msgs/OccupancyGridUpdate``s.

    An update is a rectangle of cells that replaces cells of the map. A map is neither decoded nor
    copied until an update comes. Maps must be in ``frame``, or without a frame.
    """

    def __init__(self, codec: RosCodec, frame: str) -> None:
        self._codec, self._frame = codec, frame
        self._raw: bytes | None = None
        self._message: Any = None

    def take(self, raw: bytes) -> None:
        """Replace the map."""
        try:
            message = self._codec.read(raw, "map")
        except InputError:
            pass  # labelling reports the error
        else:
            self._check_frame(message)
        self._raw, self._message = raw, None

    def update(self, raw: bytes) -> None:
        """Apply an update of a part of the map."""
        update = self._codec.read(raw, "map_updates")
        self._check_frame(update)
        if self._message is None:
            if self._raw is None:
                raise InputError("an update of the map came before the map, and is dropped")
            message = self._codec.read(self._raw, "map")
            message.data = np.array(message.data)  # arrays on the message's bytes are read-only
            self._message, self._raw = message, None
        info = self._message.info
        rows, columns = (
            slice(first, first + number)
            for first, number in ((update.y, update.height), (update.x, update.width))
        )
        fits = 0 <= rows.start <= rows.stop <= info.height
        fits = fits and 0 <= columns.start <= columns.stop <= info.width
        is_whole = len(self._message.data) == info.height * info.width
        if not (fits and is_whole) or len(update.data) != update.height * update.width:
            raise InputError(
                f"an update of {update.width} x {update.height} cells at ({update.x}, {update.y}) "
                f"with {len(update.data)} values is no part of the map of {info.width} x "
                f"{info.height} cells, and is dropped; check its publisher"
            )
        cells = self._message.data.reshape(info.height, info.width)
        cells[rows, columns] = np.reshape(update.data, (update.height, update.width))

    def raw(self) -> bytes:
        """The bytes of the updated map."""
        if self._raw is None:
            self._raw, self._message = self._codec.write(self._message, "map"), None
        return self._raw

    def _check_frame(self, message: Any) -> None:
        frame = str(message.header.frame_id).lstrip("/")
        if frame not in ("", self._frame.lstrip("/")):
            raise InputError(
                f"the map is in the frame {frame!r}, but positions are looked up in "
                f"{self._frame!r}: it is not used (map_frame)"
            )


@dataclass(frozen=True, eq=False)
class LabelledMapMessages:
    """A labelled map: the view for look-ups, and the messages of ``SHOWN``, ready to be sent."""

    view: MapView
    messages: Mapping[str, bytes]

    def write(self, folder: Path) -> None:
        """Write it into a folder for another process."""
        self.view.write(folder)
        for name, raw in self.messages.items():
            (folder / f"{name}.cdr").write_bytes(raw)

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Open the files of :meth:`write`."""
        messages = {name: (folder / f"{name}.cdr").read_bytes() for name in SHOWN}
        return cls(MapView.open(folder), messages)


class MapLabeller:
    """Labels the maps of one robot from the bytes of messages."""

    def __init__(self, live_map: LiveMap) -> None:
        self._live_map, self._codec = live_map, RosCodec()

    def label(self, raw: bytes) -> LabelledMapMessages:
        """The labelled map of a ``nav_msgs/OccupancyGrid``."""
        message = self._codec.read(raw, "map")
        found = self._live_map.on_map(grid_of_message(message))
        for warning in found.warnings:
            sys.stderr.write(f"{warning}\n")
        return LabelledMapMessages(MapView.of(found), self._messages(found, message))

    def _messages(self, found: LiveLabels, message: Any) -> dict[str, bytes]:
        frame = message.header.frame_id
        types = self._codec.store.types
        ros = ROS(types, frame)
        marker_type = types["visualization_msgs/msg/Marker"]
        clear = ros.marker("CUBE", "", 0, colour=ros.colour((0.0, 0.0, 0.0)), scale=(1.0, 1.0, 1.0))
        clear.action = marker_type.DELETEALL
        markers = place_markers(ros, found.topology)
        markers.markers.insert(0, clear)
        grid = type(message)(message.header, message.info, class_grid(found.topology).ravel())
        return {
            "label_map": self._codec.write(grid, "label_map"),
            "markers": self._codec.write(markers, "markers"),
            "topology": self._codec.text(_topology_text(found, frame), "topology"),
            "places": self._codec.write(self._places(found, message.header), "places"),
        }

    def _places(self, found: LiveLabels, header: Any) -> Any:
        """The places and connections as a ``pgm_places_msgs/Places``."""
        kind, graph = self._codec.store.types, found.topology.graph
        point = kind["geometry_msgs/msg/Point"]
        regions = [
            kind["pgm_places_msgs/msg/Region"](
                number,
                values["name"],
                values["label"],
                values["area_m2"],
                point(values["x_m"], values["y_m"], 0.0),
                values["clearance_m"],
                values.get("confidence", math.nan),
            )
            for number, values in graph.nodes(data=True)
        ]
        connections = [
            kind["pgm_places_msgs/msg/Connection"](
                *sorted((a, b)),
                point(values["x_m"], values["y_m"], 0.0),
                values["width_m"],
                values["length_m"],
            )
            for a, b, values in graph.edges(data=True)
        ]
        changes = (np.array(ids, np.uint32) for ids in (found.appeared, found.vanished))
        return kind[TYPES["places"]](header, found.map_seq, regions, connections, *changes)


def _topology_text(found: LiveLabels, frame: str) -> str:
    """Places, connections and changes as JSON."""
    graph = found.topology.graph
    record = {
        "map_seq": found.map_seq,
        "frame": frame,
        "places": [{"id": place, **values} for place, values in graph.nodes(data=True)],
        "connections": [{"a": a, "b": b, **values} for a, b, values in graph.edges(data=True)],
        "appeared": list(found.appeared),
        "vanished": list(found.vanished),
        "merged": {str(gone): place for gone, place in found.merged.items()},
        "parted": {str(new): place for new, place in found.parted.items()},
        "moved_m": {str(place): round(metres, 3) for place, metres in found.moved.items()},
    }
    return json.dumps(record, ensure_ascii=False)


SESSION = "session.json"
NICENESS = 10
"""Niceness of the process."""

MOST_STARTS = 3
"""Most starts of the process without a labelled map."""

MapAnswer = LabelledMapMessages | str
"""A labelled map, or a line with the problem."""


class MapLabellingService(Protocol):
    """A service to which maps are submitted one at a time."""

    @property
    def is_idle(self) -> bool:
        """Whether the next map can be submitted."""
        ...

    def submit(self, raw: bytes) -> None:
        """Submit the bytes of a map."""
        ...

    def answer(self) -> MapAnswer | None:
        """The result of the submitted map; None until it is ready."""
        ...

    def close(self) -> None:
        """End the service."""
        ...


class MapProcess:
    """A second process that labels maps, on all cores but one by default.

    If it ends, it is restarted with the map that it was labelling. The places are stored in the
    file ``session`` with every map, so that they keep their ids.
    """

    def __init__(
        self,
        model: str,
        *,
        method: str | None = None,
        n_threads: int | None = None,
        session: Path | None = None,
    ) -> None:
        if session is not None:
            read_session(session)  # errors appear now, and not with the first map
        self._folder = TemporaryDirectory(prefix="pgm-places-live-", ignore_cleanup_errors=True)
        self._answers: SimpleQueue[dict[str, str]] = SimpleQueue()
        self._count, self.is_idle = 0, True
        order = {
            "model": str(model),
            "method": method,
            "n_threads": n_threads or max((os.cpu_count() or 2) - 1, 1),
            "folder": self._folder.name,
            "session": str(session or Path(self._folder.name) / SESSION),
        }
        module = "pgm_places.live.map_process"
        self._command = [sys.executable, "-P", "-m", module, json.dumps(order)]
        self._n_starts, self._busy_with = 0, ""
        self._start()

    def _start(self) -> None:
        self._n_starts += 1
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def submit(self, raw: bytes) -> None:
        """Submit the bytes of a map."""
        self._count, self.is_idle = self._count + 1, False
        folder = Path(self._folder.name) / str(self._count)
        folder.mkdir()
        (folder / "map.cdr").write_bytes(raw)
        self._busy_with = str(folder)
        self._hand_over()

    def _hand_over(self) -> None:
        with contextlib.suppress(OSError):  # it has ended: the listener reports it
            _pipe(self._process.stdin).write(f"{self._busy_with}\n")

    def answer(self) -> MapAnswer | None:
        """The result of the submitted map; None until it is ready."""
        try:
            found = self._answers.get_nowait()
        except Empty:
            return None
        if "folder" not in found:
            return self._after_end(found["error"])
        self.is_idle, self._n_starts = True, 1
        folder = Path(found["folder"])
        try:
            if "error" in found:
                return f"the map is not labelled: {found['error']}"
            return LabelledMapMessages.open(folder)
        finally:
            # Memory-mapped arrays outlive their files, except on Windows.
            shutil.rmtree(folder, ignore_errors=True)

    def _after_end(self, error: str) -> str:
        """Restart the process; if it keeps ending, no further map is accepted."""
        if self._n_starts > MOST_STARTS:
            return f"{error} again; it is not started any more"
        self._end()
        self._start()
        again = f"{error}; it is started again, and places keep their ids"
        if self.is_idle:
            return again
        self._hand_over()
        return f"{again}; the map is labelled now"

    def close(self) -> None:
        """End the process."""
        self._end()
        self._folder.cleanup()

    def _end(self) -> None:
        self._process.terminate()
        self._process.wait()
        self._listener.join()
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):  # unread bytes can no longer be written
                _pipe(stream).close()

    def _listen(self) -> None:
        for line in _pipe(self._process.stdout):
            self._answers.put(json.loads(line))
        code = self._process.wait()
        self._answers.put({"error": f"the process that labels maps has ended (exit code {code})"})


def _pipe(stream: IO[str] | None) -> IO[str]:
    assert stream is not None  # both are pipes
    return stream


def main() -> None:
    """Label maps: reads a folder per line, and writes it again once its map is labelled."""
    order = json.loads(sys.argv[1])
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    folder = order.pop("folder")
    with contextlib.suppress(BrokenPipeError):
        _label_maps(**order)
    shutil.rmtree(folder, ignore_errors=True)  # the node has ended, perhaps killed


def _label_maps(model: str, method: str | None, n_threads: int, session: str) -> None:
    labeller: MapLabeller | None = None
    for line in sys.stdin:
        folder, answer = Path(line.rstrip("\n")), {"folder": line.rstrip("\n")}
        try:
            if labeller is None:
                loaded = LoadedModel.load(ModelOptions(model=model, method=method))
                memory = read_session(session)
                labeller = MapLabeller(LiveMap(loaded, memory=memory, n_threads=n_threads))
            labeller.label((folder / "map.cdr").read_bytes()).write(folder)
            _keep(session, memory)
        except PgmPlacesError as error:
            answer["error"] = str(error)
        print(json.dumps(answer), flush=True)  # noqa: T201  the node reads it


def _keep(session: str, memory: PlaceIds) -> None:
    """Update the session file; on a full disk its ids are lost, but not this map."""
    try:
        write_session(session, memory)
    except OutputError as error:
        sys.stderr.write(f"the places of the session are not saved: {error}\n")


if __name__ == "__main__":
    main()
