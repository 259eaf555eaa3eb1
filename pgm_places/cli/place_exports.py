"""Exports of places as the command line asks for them, and their record in the places' folder."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import pgm_places as pp
from pgm_places.cli.terminal import complain, say
from pgm_places.errors import InputError
from pgm_places.options import from_mapping, plain_values

if TYPE_CHECKING:
    from pgm_places.topology.topological_map import TopologicalMap

FORMAT, SCHEMA = "pgm-places exports", 1
MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class ExportRequest:
    """What ``pgm-places export`` was asked for.

    Parameters
    ----------
    to : str
        The format.
    values : tuple of str
        ``NAME=NUMBER``.
    robot_radius_m : float or None
    keep_out : tuple of str
        Classes and places.
    map_yaml : str or None
        The map; None for the one that was labelled.
    """

    to: str
    values: tuple[str, ...] = ()
    robot_radius_m: float | None = None
    keep_out: tuple[str, ...] = ()
    map_yaml: str | None = None

    def __post_init__(self) -> None:
        if self.keep_out and self.to not in ("nav2", "nav2-route"):
            raise InputError(f"the export {self.to!r} takes no --keep-out; nav2 and nav2-route do")
        if self.map_yaml and self.to not in ("nav2", "map"):
            raise InputError(f"the export {self.to!r} takes no --map; nav2 and map do")

    def renamed(self, old: str, new: str) -> Self:
        """The request with another name for a place."""
        values = tuple(
            f"{new}={text.rpartition('=')[2]}" if text.rpartition("=")[0].strip() == old else text
            for text in self.values
        )
        keep_out = tuple(new if name == old else name for name in self.keep_out)
        return replace(self, values=values, keep_out=keep_out)

    def write(self, stage: Path, folder: Path, lies_in: Path, topology: "TopologicalMap") -> str:
        """Write the files of places in a folder, which will lie in ``lies_in``; a summary.

        Raises
        ------
        InputError
            A format, name or value that does not fit.
        OutputError
            A file cannot be written.
        """
        from pgm_places.io.places.exports import export, write_cleaned_map

        values = _values(self.values)
        if self.to == "nav2":
            topology.ids_of(self.keep_out)  # a wrong name is refused before anything is read
            grid = self._map(folder)
            return self._routes(stage, topology, lies_in, {"speeds_m_s": values, "grid": grid})
        if self.to == "map":
            grid = self._map(folder)
            if grid is None:
                raise InputError(f"{folder}: the map is not where it was labelled; pass --map")
            write_cleaned_map(stage, topology, grid)
        elif self.to == "nav2-route" and not values:
            return self._routes(stage, topology, lies_in)
        else:
            export(
                topology,
                self.to,
                stage,
                values=values or None,
                robot_radius_m=self.robot_radius_m,
                name=folder.resolve().name,
                lies_in=lies_in,
            )
        return ""

    def _routes(
        self,
        stage: Path,
        topology: "TopologicalMap",
        lies_in: Path,
        for_nav2: dict[str, Any] | None = None,
    ) -> str:
        """Write the route graph and its picture; its size, and what the robot cannot reach."""
        from pgm_places.pictures.route_picture import routes_summary, write_routes
        from pgm_places.topology.route_graph import ROBOT_RADIUS_M

        routes = write_routes(
            stage,
            topology,
            robot_radius_m=ROBOT_RADIUS_M if self.robot_radius_m is None else self.robot_radius_m,
            keep_out=self.keep_out,
            for_nav2=for_nav2,
            lies_in=lies_in,
        )
        return routes_summary(topology, routes)

    def _map(self, folder: Path) -> "pp.OccupancyGrid | None":
        """The map that was labelled, or the one that was given instead; says what is amiss."""
        from pgm_places.labelling.files import labelled_map

        path = labelled_map(folder) if self.map_yaml is None else Path(self.map_yaml)
        if path is None:
            complain("the map is not copied, because it is not where it was labelled; pass --map")
            return None
        grid = pp.load_map(path).grid
        if grid.yaw_rad:
            complain(
                f"the origin of the map is turned by {grid.yaw_rad:g} rad, which Nav2's costmaps "
                "and filters ignore: save the map with a yaw of 0"
            )
        return grid


def write_exports(
    stage: Path, folder: Path, topology: "TopologicalMap", requests: Iterable[ExportRequest]
) -> None:
    """Write exports into a set of files for the folder of the places, and record them."""
    for request in requests:
        summary = request.write(stage, folder, folder, topology)
        if summary:
            say(summary)
    record_exports(stage, requests)


def record_exports(stage: Path, requests: Iterable[ExportRequest]) -> None:
    """Write the record of exports, by which ``rename`` repeats them."""
    from pgm_places.io.atomic import write_json
    from pgm_places.io.places.result_folder import EXPORTS_FILE

    record = {"format": FORMAT, "schema": SCHEMA, "exports": [*map(plain_values, requests)]}
    path = stage / EXPORTS_FILE
    path.parent.mkdir(exist_ok=True)
    write_json(path, record, indent=1)


def recorded_exports(folder: Path) -> list[ExportRequest]:
    """The exports in the folder of places, the newest of each format.

    Raises
    ------
    InputError
        The record is damaged.
    """
    from pgm_places.io.input_file import read_record
    from pgm_places.io.places.result_folder import EXPORTS_FILE

    path = folder / EXPORTS_FILE
    if not path.exists():
        return []
    remedy = "delete it and export again"
    with read_record(
        path, "a record of exports", FORMAT, SCHEMA, max_bytes=MAX_BYTES, remedy=remedy
    ) as record:
        items = enumerate(record["exports"])
        return [from_mapping(ExportRequest, item, path=f"exports[{k}]") for k, item in items]


def _values(texts: Sequence[str]) -> dict[str, float]:
    """``["room=100"]`` as ``{"room": 100.0}``."""
    values = {}
    for text in texts:
        name, equals, number = text.rpartition("=")
        if not equals or not name or not re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", number.strip()):
            raise InputError(f"--set expects NAME=NUMBER, such as room=100, got {text!r}")
        values[name.strip()] = float(number)
    return values
