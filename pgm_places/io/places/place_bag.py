"""Export as a ROS 2 bag (MCAP): a grid of classes and markers, for Foxglove and RViz."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.io.atomic import atomic_folder
from pgm_places.io.logs.bag_writer import ros2_writer
from pgm_places.palette import label_colours, rgb_of
from pgm_places.plugins import needed
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

_AREA_ALPHA = 0.5
_AREA_Z_M, _LINE_Z_M, _NAME_Z_M = 0.01, 0.03, 0.3
_LINE_M, _POINT_M, _TEXT_M = 0.05, 0.2, 0.35
_INK = (0.1, 0.1, 0.1)


@dataclass(frozen=True)
class ROS:
    """Messages of one ROS distribution, by the names of their types, in one coordinate frame."""

    types: Mapping[str, Any]
    frame: str

    def new(self, name: str, **fields: Any) -> Any:
        """A message of the type ``name``."""
        return self.types[name](**fields)

    def no_time(self) -> Any:
        """Time 0, which means the latest transform."""
        return self.new("builtin_interfaces/msg/Time", sec=0, nanosec=0)

    def header(self) -> Any:
        """A header of the frame, without a time."""
        return self.new("std_msgs/msg/Header", stamp=self.no_time(), frame_id=self.frame)

    def point(self, x: float, y: float, z: float) -> Any:
        """A point in metres."""
        return self.new("geometry_msgs/msg/Point", x=float(x), y=float(y), z=float(z))

    def turn(self, yaw_rad: float) -> Any:
        """The rotation about the vertical axis."""
        z, w = float(np.sin(yaw_rad / 2)), float(np.cos(yaw_rad / 2))
        return self.new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w)

    def pose(self, x: float, y: float, z: float, yaw_rad: float = 0.0) -> Any:
        """A pose that stands upright."""
        at, turn = self.point(x, y, z), self.turn(yaw_rad)
        return self.new("geometry_msgs/msg/Pose", position=at, orientation=turn)

    def colour(self, rgb: Sequence[float], alpha: float = 1.0) -> Any:
        """A colour; parts from 0 to 1."""
        r, g, b = rgb
        return self.new("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=alpha)

    def marker(
        self,
        kind: str,
        space: str,
        number: int,
        *,
        colour: Any,
        scale: tuple[float, float, float],
        points: Iterable[Any] = (),
        at: tuple[float, float, float] = (0.0, 0.0, 0.0),
        text: str = "",
    ) -> Any:
        """A marker of a kind such as ``"LINE_LIST"``; it stays until it is replaced."""
        cls = self.types["visualization_msgs/msg/Marker"]
        x, y, z = scale
        nothing = np.zeros(0, np.uint8)
        return cls(
            header=self.header(),
            ns=space,
            id=number,
            type=getattr(cls, kind),
            action=cls.ADD,
            pose=self.pose(*at),
            scale=self.new("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            color=colour,
            lifetime=self.new("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            frame_locked=False,
            points=list(points),
            colors=[],
            texture_resource="",
            texture=self.new(
                "sensor_msgs/msg/CompressedImage", header=self.header(), format="", data=nothing
            ),
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=self.new("visualization_msgs/msg/MeshFile", filename="", data=nothing),
            mesh_use_embedded_materials=False,
        )


def place_markers(ros: ROS, topology: TopologicalMap) -> Any:
    """A MarkerArray: areas, outlines, names and gates by id of place, and paths."""
    names = topology.label_names
    colours = {
        name: (rgb_of(colour) / 255).tolist()
        for name, colour in zip(names, label_colours(names), strict=True)
    }
    markers = []
    for region in topology.regions:
        colour = colours[region.label]
        markers.append(_area(ros, topology, region, colour))
        rings = [ring.tolist() for rings in region.polygons for ring in rings]
        ends = [end for ring in rings for side in itertools.pairwise(ring) for end in side]
        markers.append(_lines(ros, "LINE_LIST", "outlines", region.id, colour, ends))
        if region.gate is not None:
            corners = region.gate.corners_m.tolist()
            closed = [*corners, corners[0]]
            markers.append(_lines(ros, "LINE_STRIP", "gates", region.id, colour, closed))
        markers.append(
            ros.marker(
                "TEXT_VIEW_FACING",
                "names",
                region.id,
                colour=ros.colour(_INK),
                scale=(0.0, 0.0, _TEXT_M),
                at=(*region.anchor_m, _NAME_Z_M),
                text=region.name,
            )
        )
    if topology.connections:
        markers += _paths(ros, topology)
    return ros.new("visualization_msgs/msg/MarkerArray", markers=markers)


def _area(ros: ROS, topology: TopologicalMap, region: Region, colour: Sequence[float]) -> Any:
    """Two triangles per run of cells in a row."""
    corners = topology.grid.cell_centres_m(_run_corners(topology, region) - 0.5)
    return ros.marker(
        "TRIANGLE_LIST",
        "areas",
        region.id,
        colour=ros.colour(colour, _AREA_ALPHA),
        scale=(1.0, 1.0, 1.0),
        points=[ros.point(x, y, _AREA_Z_M) for x, y in corners.tolist()],
    )


def _run_corners(topology: TopologicalMap, region: Region) -> NDArray[np.float64]:
    """(6 n, 2) row and column of the triangles' corners, counted along the cells' edges."""
    rows, columns = topology.window(region.id)
    inside = np.pad(topology.region[rows, columns] == region.id, ((0, 0), (1, 1)))
    step = np.diff(inside.astype(np.int8), axis=1)
    row, start = np.nonzero(step == 1)
    _, end = np.nonzero(step == -1)
    low, left, right = row + rows.start, start + columns.start, end + columns.start
    triangles = [(low, left), (low, right), (low + 1, right)]
    triangles += [(low, left), (low + 1, right), (low + 1, left)]
    corners = np.array([np.stack(corner, axis=1) for corner in triangles], np.float64)
    return corners.swapaxes(0, 1).reshape(-1, 2)


def _lines(
    ros: ROS,
    kind: str,
    space: str,
    number: int,
    colour: Sequence[float],
    ends: Iterable[Sequence[float]],
) -> Any:
    points = [ros.point(x, y, _LINE_Z_M) for x, y in ends]
    size = (_LINE_M, 0.0, 0.0)
    return ros.marker(kind, space, number, colour=ros.colour(colour), scale=size, points=points)


def _paths(ros: ROS, topology: TopologicalMap) -> list[Any]:
    """Lines from anchor to passage to anchor, and a ball in each passage."""
    middles = [ros.point(*item.point_m, _LINE_Z_M) for item in topology.connections]
    ends = [
        end
        for item in topology.connections
        for number in (item.first, item.second)
        for end in (topology.place(number).anchor_m, item.point_m)
    ]
    ink, size = ros.colour(_INK), (_POINT_M, _POINT_M, _POINT_M)
    return [
        _lines(ros, "LINE_LIST", "paths", 0, _INK, ends),
        ros.marker("SPHERE_LIST", "passages", 0, colour=ink, scale=size, points=middles),
    ]


GRID_TOPIC, MARKER_TOPIC = "/place_classes", "/places"
_GRID_TYPE, _MARKER_TYPE = "nav_msgs/msg/OccupancyGrid", "visualization_msgs/msg/MarkerArray"


def class_grid(topology: TopologicalMap) -> NDArray[np.int8]:
    """(H, W) number of the class of each cell, from 1 in the order of the labels; -1 elsewhere.

    Numbers above 100 have no meaning in an OccupancyGrid, so classes from the 100th on share 100.
    """
    numbers = np.minimum(topology.labels + 1, 100)
    return np.where(numbers > 0, numbers, -1).astype(np.int8)


def write_place_bag(folder: Path | str, topology: TopologicalMap) -> list[Path]:
    """Write a bag, a folder with an MCAP file and its ``metadata.yaml``; returns the paths.

    Topics: ``/place_classes`` (``nav_msgs/OccupancyGrid``, the class of each cell from 1, with the
    map's origin and yaw) and ``/places`` (``visualization_msgs/MarkerArray``: areas, outlines,
    names, paths). Each has one message at time 0, latched when played. An existing bag is replaced.
    Foxglove opens the MCAP file; ``ros2 bag play`` the folder. It needs the extra ``bags``.
    """
    target = Path(folder)
    typesys = needed("rosbags.typesys", extra="bags", purpose="writing MCAP")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    ros = ROS(store.types, "map")
    messages = {
        GRID_TOPIC: _occupancy_grid(ros, topology),
        MARKER_TOPIC: place_markers(ros, topology),
    }
    with (
        atomic_folder(target, replaces=_is_bag) as temporary,
        ros2_writer(temporary, target.name, "MCAP") as writer,
    ):
        for topic, message in messages.items():
            connection = writer.add_connection(
                topic, message.__msgtype__, typestore=store, offered_qos_profiles=[_latched()]
            )
            writer.write(connection, 0, store.serialize_cdr(message, message.__msgtype__))
    return [target / "metadata.yaml", target / f"{target.name}.mcap"]


def _is_bag(folder: Path) -> bool:
    """Whether a folder holds only a bag of this package."""
    return {path.name for path in folder.iterdir()} == {"metadata.yaml", f"{folder.name}.mcap"}


def _latched() -> Any:
    """Quality of service of a map: late subscribers still get the last message."""
    kinds = needed("rosbags.interfaces", extra="bags", purpose="writing MCAP")
    forever = kinds.QosTime(9223372036, 854775807)
    return kinds.Qos(
        kinds.QosHistory.KEEP_LAST,
        1,
        kinds.QosReliability.RELIABLE,
        kinds.QosDurability.TRANSIENT_LOCAL,
        forever,
        forever,
        kinds.QosLiveliness.AUTOMATIC,
        forever,
        False,
    )


def _occupancy_grid(ros: ROS, topology: TopologicalMap) -> Any:
    grid = topology.grid
    height, width = grid.shape
    return ros.new(
        _GRID_TYPE,
        header=ros.header(),
        info=ros.new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=ros.no_time(),
            resolution=grid.resolution_m,
            width=width,
            height=height,
            origin=ros.pose(*grid.origin_xy_m, 0.0, grid.yaw_rad),
        ),
        data=class_grid(topology).ravel(),
    )
