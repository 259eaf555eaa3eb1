"""settings.json: the rules and gates from which a folder's places were made."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from pgm_places.errors import InputError, OutputError
from pgm_places.io.atomic import write_json
from pgm_places.io.input_file import read_record
from pgm_places.io.places.result_folder import (
    GATES_FILE,
    SETTINGS_FILE,
    SETTINGS_FORMAT,
    settings_path,
)
from pgm_places.io.places.topology_files import MAX_BYTES, MOST, Raster, items_of, write_numbers
from pgm_places.maps.components import number_type
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import from_mapping, plain_values
from pgm_places.options.marks import Ge, Le
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate
from pgm_places.topology.rules import TopologyOptions, stored_options

_SCHEMA = 1
_SETTINGS = "the settings of places, as 'pgm-places label' and 'pgm-places topology' write them"


@dataclass(frozen=True, eq=False)
class PlaceSettings:
    """The rules and gates from which places were made; None if doorways came from labels."""

    rules: TopologyOptions
    doorways: Doorways | None = None


@dataclass(frozen=True)
class _GateRecord:
    """A gate with all digits: rounding could exclude cells on the edge of its rectangle."""

    centre_m: tuple[float, float]
    heading_rad: float
    width_m: Annotated[float, Ge(0)]
    depth_m: Annotated[float, Ge(0)]
    probability: Annotated[float, Ge(0), Le(1)]

    @property
    def gate(self) -> Gate:
        """The rectangle."""
        return Gate(self.centre_m, self.heading_rad, self.width_m, self.depth_m)


def save_settings(folder: Path, settings: PlaceSettings) -> list[Path]:
    """Write rules and gates to ``details/settings.json`` in a folder; returns the paths.

    With gates, ``details/gate_places.png`` has the place between gates at each cell (16 bits, from
    1, 0 for none, the top row first).
    """
    record: dict[str, Any] = {
        "format": SETTINGS_FORMAT,
        "schema": _SCHEMA,
        "settings": plain_values(settings.rules),
    }
    written = []
    if settings.doorways is not None:
        record["map"] = plain_values(Raster.of(settings.doorways.grid))
        gates = zip(settings.doorways.gates, settings.doorways.probability, strict=True)
        record["gates"] = [
            plain_values(_GateRecord(g.centre_m, g.heading_rad, g.width_m, g.depth_m, float(p)))
            for g, p in gates
        ]
        record["removed_gates"] = [plain_values(gate) for gate in settings.doorways.removed]
        count = int(settings.doorways.place.max(initial=-1)) + 1
        if count > MOST:
            raise OutputError(
                f"{folder / GATES_FILE}: the gates part {count} places, but the image holds only "
                f"{MOST}; cut the map into parts"
            )
        written.append(write_numbers(folder / GATES_FILE, settings.doorways.place + 1))
    return [write_json(folder / SETTINGS_FILE, record, indent=1), *written]


def load_settings(folder: Path) -> PlaceSettings | None:
    """The settings in a folder; None if it has none."""
    path = settings_path(folder)
    if not path.exists():
        return None
    again = "label the map again"
    with read_record(
        path, _SETTINGS, SETTINGS_FORMAT, _SCHEMA, max_bytes=MAX_BYTES, remedy=again
    ) as record:
        rules = stored_options(record["settings"], path="settings")
        return PlaceSettings(rules, _doorways(path.parent, record) if "gates" in record else None)


def _doorways(folder: Path, record: dict[str, Any]) -> Doorways:
    """The gates, on a raster whose resolution may differ from the map's."""
    raster = from_mapping(Raster, record["map"], path="map")
    gates = items_of(_GateRecord, record, "gates")
    numbers = raster.read_numbers(folder / Path(GATES_FILE).name)
    grid, place = raster.grid(numbers > 0), numbers - 1
    for k, gate_record in enumerate(gates):
        _require_on_map(f"gates[{k}]", gate_record.gate, grid)
    probability = np.array([gate_record.probability for gate_record in gates], np.float64)
    place = place.astype(number_type(int(place.max()) + 1))
    removed: tuple[Gate, ...] = ()
    if "removed_gates" in record:  # absent in files of earlier versions
        removed = items_of(Gate, record, "removed_gates")
    accepted = tuple(gate_record.gate for gate_record in gates)
    return Doorways(grid, accepted, probability, place, removed)


def _require_on_map(path: str, gate: Gate, grid: OccupancyGrid) -> None:
    longest_m = float(np.hypot(*grid.shape)) * grid.resolution_m
    away_m = float(np.hypot(*np.subtract(gate.centre_m, grid.origin_xy_m)))
    if max(gate.width_m, gate.depth_m, away_m) > longest_m:
        raise InputError(f"{path} does not lie on the map; label the map again")
