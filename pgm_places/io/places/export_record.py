"""Record of exports of a folder's places, by which ``rename`` and others repeat them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import read_record
from pgm_places.io.places.result_folder import EXPORTS_FILE
from pgm_places.options import from_mapping, plain_values

FORMAT, SCHEMA = "pgm-places exports", 1
MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class ExportRequest:
    """The parameters of an export of places, as in ``pgm-places export``.

    Parameters
    ----------
    to : str
        The format.
    values : tuple of str
        ``NAME=NUMBER``.
    robot_radius_m : float or None
    keep_out : tuple of str
        Classes and places that the robot must not enter.
    map_yaml : str or None
        The map; None for the labelled one.
    out : str or None
        The output folder; None for the folder of the places.
    """

    to: str
    values: tuple[str, ...] = ()
    robot_radius_m: float | None = None
    keep_out: tuple[str, ...] = ()
    map_yaml: str | None = None
    out: str | None = None

    def __post_init__(self) -> None:
        if self.keep_out and self.to not in ("nav2", "nav2-route"):
            raise InputError(
                f"the export {self.to!r} accepts no --keep-out; nav2 and nav2-route do"
            )
        if self.map_yaml and self.to not in ("nav2", "map"):
            raise InputError(f"the export {self.to!r} accepts no --map; nav2 and map do")

    def renamed(self, old: str, new: str) -> Self:
        """The request with another name for a place."""
        values = tuple(
            f"{new}={text.rpartition('=')[2]}" if text.rpartition("=")[0].strip() == old else text
            for text in self.values
        )
        keep_out = tuple(new if name == old else name for name in self.keep_out)
        return replace(self, values=values, keep_out=keep_out)


def record_exports(stage: Path, folder: Path, requests: Sequence[ExportRequest]) -> None:
    """Write the record of exports, by which ``rename`` repeats them.

    A request replaces an earlier one of the same format and output folder in the ``folder`` of the
    places.
    """
    new = {(request.to, request.out) for request in requests}
    others = (
        request for request in recorded_exports(folder) if (request.to, request.out) not in new
    )
    requests = [*others, *requests]
    record = {"format": FORMAT, "schema": SCHEMA, "exports": [*map(plain_values, requests)]}
    path = stage / EXPORTS_FILE
    path.parent.mkdir(exist_ok=True)
    write_json(path, record, indent=1)


def recorded_exports(folder: Path) -> list[ExportRequest]:
    """The recorded exports of a folder's places, the newest per format and output folder.

    Raises
    ------
    InputError
        The record is damaged.
    """
    path = folder / EXPORTS_FILE
    if not path.exists():
        return []
    remedy = "delete it and export again"
    with read_record(
        path, "a record of exports", FORMAT, SCHEMA, max_bytes=MAX_BYTES, remedy=remedy
    ) as record:
        items = enumerate(record["exports"])
        return [from_mapping(ExportRequest, item, path=f"exports[{k}]") for k, item in items]
