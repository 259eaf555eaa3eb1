"""The places to check first as a table, for spreadsheets."""

from collections.abc import Iterable
from pathlib import Path

from pgm_places.io.atomic import write_text
from pgm_places.io.csv_table import csv_text
from pgm_places.topology.checks import places_to_check
from pgm_places.topology.hidden_rooms import hidden_rooms
from pgm_places.topology.topological_map import TopologicalMap

CHECK_FILE = "check.csv"
_PLACE = ("id", "name", "label", "second_label", "probability", "second_probability", "area_m2")
_COLUMNS = (*_PLACE, "doubt", "doubtful_m2", "x_m", "y_m", "rooms", "to_split")


def check_table(topology: TopologicalMap) -> str:
    """Comma-separated values: a row per place, those with the most doubtful area first.

    Columns: ``id``, ``name``, ``label``, ``second_label``, ``probability`` of the label,
    ``second_probability``, ``area_m2``, ``doubt`` (1 - probability), ``doubtful_m2`` (doubt times
    area), ``x_m``, ``y_m``: the place's anchor in the map frame, ``rooms``: how many rooms the
    place looks like, if more than one, and ``to_split``: the command that makes them places, to be
    run in the table's folder.
    """
    count = {item.place.id: item.count for item in hidden_rooms(topology)}
    rows: list[Iterable[object]] = [_COLUMNS]
    for check in places_to_check(topology):
        place, second = check.place, check.second_probability
        row: list[object] = [place.id, place.name, place.label, check.second_label or ""]
        row += [f"{check.probability:.4f}", "" if second is None else f"{second:.4f}"]
        row += [f"{place.area_m2:.3f}", f"{check.doubt:.4f}", f"{check.doubtful_m2:.3f}"]
        row += [f"{value:.3f}" for value in place.anchor_m]
        if place.id in count:
            row += [count[place.id], f"pgm-places split . {place.id}"]
        rows.append(row + [""] * (len(_COLUMNS) - len(row)))
    return csv_text(rows)


def write_checks(path: Path | str, topology: TopologicalMap) -> Path:
    """Write the table; the path.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    return write_text(path, check_table(topology))
