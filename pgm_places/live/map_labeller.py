"""MapLabeller: from the bytes of a map to its labelled view and the messages that show it."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from pgm_places.io.logs.map_messages import grid_of_message
from pgm_places.io.places.place_bag import class_grid
from pgm_places.io.places.place_markers import ROS, place_markers
from pgm_places.live.live_map import LiveLabels, LiveMap
from pgm_places.live.map_view import MapView
from pgm_places.live.ros_codec import SHOWN, TYPES, RosCodec


@dataclass(frozen=True, eq=False)
class LabelledMapMessages:
    """A labelled map: what the robot asks, and what is published of it.

    Parameters
    ----------
    view : MapView
    messages : mapping of str to bytes
        Those of ``SHOWN``, ready to be sent.
    """

    view: MapView
    messages: Mapping[str, bytes]

    def write(self, folder: Path) -> None:
        """Write it into a folder, from which another process opens it."""
        self.view.write(folder)
        for name, raw in self.messages.items():
            (folder / f"{name}.cdr").write_bytes(raw)

    @classmethod
    def open(cls, folder: Path) -> Self:
        """What :meth:`write` wrote."""
        messages = {name: (folder / f"{name}.cdr").read_bytes() for name in SHOWN}
        return cls(MapView.open(folder), messages)


class MapLabeller:
    """Labels the maps of one robot as their bytes come.

    Parameters
    ----------
    live_map : LiveMap
    """

    def __init__(self, live_map: LiveMap) -> None:
        self._live_map, self._codec = live_map, RosCodec()

    def label(self, raw: bytes) -> LabelledMapMessages:
        """The labelled map of a ``nav_msgs/OccupancyGrid``.

        Raises
        ------
        InputError
            The map cannot be read or labelled; the one before stays current.
        """
        message = self._codec.read(raw, "map")
        found = self._live_map.on_map(grid_of_message(message))
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
    """Places and connections, and what has changed, as JSON."""
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
