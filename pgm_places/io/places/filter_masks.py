"""Masks for Nav2's costmap filters: zones, keep-out areas and speed limits by class or place."""

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, printable
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["FilterKind", "mask_values", "write_filter_mask"]

FilterKind: TypeAlias = Literal["keepout", "speed-percent", "speed-m-s", "binary", "zones"]
TYPES: dict[str, int] = {
    "keepout": 0,
    "speed-percent": 1,
    "speed-m-s": 2,
    "binary": 3,
    "zones": 4,
}
MOST = 100
"""map_server publishes raw values from 0 to 100; larger ones would become unknown."""


def mask_values(
    topology: TopologicalMap, values: Mapping[str, int] | None = None
) -> NDArray[np.uint8]:
    """(H, W) value of the mask at each cell, 0 where nothing is said.

    Parameters
    ----------
    topology : TopologicalMap
    values : mapping of str to int, optional
        A value from 0 to 100 for names of places and for classes; a place's own value wins over
        that of its class. By default each class has its number, from 1.

    Raises
    ------
    InputError
        A name that is neither a place nor a class, or a value out of range.
    """
    values = _named(topology, values)
    for name, value in values.items():
        if name not in topology.label_names:
            topology.place(name)
        if not 0 <= value <= MOST:
            raise InputError(f"the mask's value of {name!r} must be 0 to {MOST}, got {value}")
    highest = max((region.id for region in topology.regions), default=0)
    table = np.zeros(highest + 1, np.uint8)
    for region in topology.regions:
        table[region.id] = values.get(region.name, values.get(region.label, 0))
    mask: NDArray[np.uint8] = table[topology.region]
    return mask


def write_filter_mask(
    stem: Path | str,
    topology: TopologicalMap,
    kind: FilterKind,
    *,
    values: Mapping[str, int] | None = None,
    base: float = 0.0,
    multiplier: float = 1.0,
) -> list[Path]:
    """Write ``<stem>.png``, ``<stem>.yaml`` and ``<stem>_params.yaml``; the paths.

    The mask is a map in mode raw, so its pixels are the values that the filter sees: occupancy
    from 0 to 100. What a filter makes of them is ``base + multiplier * value``: 100 keeps out; a
    percentage or metres per second of speed, 0 for no limit; for zones the number of the state, 0
    for the nominal one. The parameters are those of ``map_server`` and
    ``costmap_filter_info_server``, whose topics the filter in your costmap has to name; for zones
    also those of a ``ZoneParameterFilter`` that knows every state of the mask, as it stops the
    robot at a value that it does not know. Setpoints are left to the user.

    Parameters
    ----------
    stem : Path
    topology : TopologicalMap
    kind : {"keepout", "speed-percent", "speed-m-s", "binary", "zones"}
    values : mapping of str to int, optional
        Values by class or name of place; for zones the classes' numbers by default.
    base, multiplier : float

    Raises
    ------
    InputError
        Values that are missing, unknown or out of range.
    OutputError
        Where a file cannot be written.
    """
    from PIL import Image

    if kind not in TYPES:
        raise InputError(f"kind must be one of {', '.join(TYPES)}, got {kind!r}")
    if values is None and kind != "zones":
        classes = ", ".join(topology.label_names)
        raise InputError(
            f"a {kind} mask needs values by class or place, such as room = 100; classes: {classes}"
        )
    target = Path(stem)
    buffer = io.BytesIO()
    mask = mask_values(topology, values)
    Image.fromarray(np.ascontiguousarray(mask[::-1])).save(buffer, "PNG")
    image_path = write_bytes(target.with_name(f"{target.name}.png"), buffer.getvalue())
    grid = topology.grid
    x, y = grid.origin_xy_m
    yaml_path = write_text(
        target.with_name(f"{target.name}.yaml"),
        f'image: "{image_path.name}"\n'
        "mode: raw\n"
        f"resolution: {grid.resolution_m!r}\n"
        f"origin: [{x!r}, {y!r}, {grid.yaw_rad!r}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    )
    topic = f"/{target.name.replace('-', '_')}_mask"
    states = _zone_states(topology, values, mask, f"{topic}_info") if kind == "zones" else ""
    params_path = write_text(
        target.with_name(f"{target.name}_params.yaml"),
        f"# {_legend(topology, values)}\n"
        "filter_mask_server:\n  ros__parameters:\n"
        f'    topic_name: "{topic}"\n    yaml_filename: "{yaml_path.name}"\n'
        "costmap_filter_info_server:\n  ros__parameters:\n"
        f"    type: {TYPES[kind]}\n"
        f'    filter_info_topic: "{topic}_info"\n    mask_topic: "{topic}"\n'
        f"    base: {float(base)!r}\n    multiplier: {float(multiplier)!r}\n{states}",
    )
    return [image_path, yaml_path, params_path]


def _zone_states(
    topology: TopologicalMap,
    values: Mapping[str, int] | None,
    mask: NDArray[np.uint8],
    info_topic: str,
) -> str:
    """Parameters of a zone filter with a state per value of the mask.

    No state has ``setpoints``, as ROS cannot read an empty list; the filter says so and goes on.
    """
    named: dict[int, list[str]] = {}
    for name, value in _named(topology, values).items():
        named.setdefault(value, []).append(re.sub(r"\W+", "_", name).strip("_"))
    used = [int(value) for value in np.unique(mask) if value]
    # Two places may differ only in signs that no parameter name takes: the number tells them apart.
    states = {value: f"{'_'.join(named[value])}_{value}" for value in used}
    listed = ", ".join(f'"{state}"' for state in states.values())
    lines = [
        "local_costmap:",
        "  local_costmap:",
        "    ros__parameters:",
        '      filters: ["zone_filter"]',
        "      zone_filter:",
        '        plugin: "nav2_costmap_2d::ZoneParameterFilter"',
        f'        filter_info_topic: "{info_topic}"',
        *([f"        states: [{listed}]"] if states else []),
        *(f"        {state}:\n          id: {value}" for value, state in states.items()),
    ]
    return "\n".join(lines) + "\n"


def _named(topology: TopologicalMap, values: Mapping[str, int] | None) -> Mapping[str, int]:
    """Values by name: the classes' numbers from 1 where none are given."""
    if values is not None:
        return values
    return {label: k + 1 for k, label in enumerate(topology.label_names)}


def _legend(topology: TopologicalMap, values: Mapping[str, int] | None) -> str:
    named = _named(topology, values)
    listed = ", ".join(f"{value} {printable(name)}" for name, value in named.items())
    return f"values: 0 nothing, {listed}"
