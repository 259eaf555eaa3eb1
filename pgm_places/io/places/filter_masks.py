"""Nav2 costmap filter masks: zones, keep-out areas and speed limits by class or place."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import yaml
from numpy.typing import NDArray

from pgm_places.errors import InputError, escape_control
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.maps.map_server import write_description
from pgm_places.io.maps.raster_image import raster_png
from pgm_places.options import check_option
from pgm_places.topology.topological_map import TopologicalMap

FilterKind: TypeAlias = Literal["keepout", "speed-percent", "speed-m-s", "binary", "zones"]

TYPES: dict[str, int] = {kind: number for number, kind in enumerate(get_args(FilterKind))}
"""The number of each kind in a CostmapFilterInfo message."""

_LIMIT = {"speed_limit_topic": "/speed_limit"}

_FILTERS: dict[str, tuple[str, str, dict[str, Any], tuple[str, ...]]] = {
    "keepout": ("keepout_filter", "KeepoutFilter", {}, ("global", "local")),
    "speed-percent": ("speed_filter", "SpeedFilter", _LIMIT, ("global",)),
    "speed-m-s": ("speed_filter", "SpeedFilter", _LIMIT, ("global",)),
    "binary": (
        "binary_filter",
        "BinaryFilter",
        {"binary_state_topic": "/binary_state", "flip_threshold": 50.0},
        ("global",),
    ),
    "zones": ("zone_filter", "ZoneParameterFilter", {}, ("local",)),
}
"""Name, plugin and output of each filter, and its costmaps."""


def filter_parameters(
    kind: FilterKind,
    name: str,
    mask_yaml: Path,
    *,
    multiplier: float = 1.0,
    states: Mapping[str, int] | None = None,
) -> dict[str, Any]:
    """The parameters of a costmap filter and its servers.

    It holds the parameters of ``map_server`` (as ``filter_mask_server``) and of
    ``costmap_filter_info_server``, and a block ``filters`` for the costmaps that names their
    topics. A costmap that already has filters needs all of them in one list.

    Parameters
    ----------
    kind : {"keepout", "speed-percent", "speed-m-s", "binary", "zones"}
    name : str
        The name of the mask; its topics are ``/NAME_mask`` and ``/NAME_mask_info``.
    mask_yaml : Path
        The mask's YAML file. The server resolves relative paths against its working folder, so this
        should be absolute.
    multiplier : float
        The filter sees ``multiplier * value``.
    states : mapping of str to int, optional
        For zones, the value of each state in the mask. All must be listed: the filter stops the
        robot at an unlisted value. No state has ``setpoints``, as ROS cannot read an empty list;
        the filter logs this and continues.

    Examples
    --------
    >>> nodes = filter_parameters("keepout", "keepout", Path("/maps/keepout.yaml"))
    >>> list(nodes)
    ['filter_mask_server', 'costmap_filter_info_server', 'global_costmap', 'local_costmap']
    >>> nodes["filter_mask_server"]["ros__parameters"]
    {'topic_name': '/keepout_mask', 'yaml_filename': '/maps/keepout.yaml'}
    """
    topic = f"/{name.replace('-', '_')}_mask"
    filter_name, plugin, output, costmaps = _FILTERS[kind]
    info = {"filter_info_topic": f"{topic}_info"}
    nodes = {
        "filter_mask_server": _node(topic_name=topic, yaml_filename=str(mask_yaml)),
        "costmap_filter_info_server": _node(
            type=TYPES[kind], **info, mask_topic=topic, base=0.0, multiplier=float(multiplier)
        ),
    }
    for costmap in costmaps:
        of_filter = {"plugin": f"nav2_costmap_2d::{plugin}", "enabled": True, **info, **output}
        if kind == "zones" and states:
            of_filter["states"] = list(states)
            of_filter |= {state: {"id": value} for state, value in states.items()}
        filters = _node(filters=[filter_name], **{filter_name: of_filter})
        nodes[f"{costmap}_costmap"] = {f"{costmap}_costmap": filters}
    if kind.startswith("speed"):
        nodes["controller_server"] = _node(**_LIMIT)
    return nodes


def _node(**parameters: Any) -> dict[str, Any]:
    return {"ros__parameters": parameters}


# map_server publishes raw values from 0 to 100; larger ones would become unknown.
MOST = 100


def mask_values(
    topology: TopologicalMap, values: Mapping[str, int] | None = None
) -> NDArray[np.uint8]:
    """(H, W) value of the mask at each cell, from 0, without a value, to 100.

    A place's value overrides its class's. By default each class has its number, from 1.
    """
    values = _named(topology, values)
    topology.ids_of(values)
    for name, value in values.items():
        if not 0 <= value <= MOST:
            raise InputError(f"the mask's value of {name!r} must be 0 to {MOST}, got {value}")
    table = np.zeros(topology.next_id, np.uint8)
    for region in topology.regions:
        table[region.id] = values.get(region.name, values.get(region.label, 0))
    return np.asarray(table[topology.region])


def write_filter_mask(
    stem: Path | str,
    topology: TopologicalMap,
    kind: FilterKind,
    *,
    values: Mapping[str, float] | None = None,
    robot_radius_m: float = 0.0,
    lies_in: Path | None = None,
    parameters: dict[str, Any] | None = None,
) -> list[Path]:
    """Write ``<stem>.png``, ``<stem>.yaml`` and ``<stem>_params.yaml``; returns the paths.

    The mask is a map in mode raw, so its pixels are the values that the filter sees: occupancy
    from 0 to 100, which it multiplies by a parameter: 100 keeps out; a percentage of speed; metres
    per second, of which the mask holds parts (rounded down, so that no robot is faster); 100
    switches a binary filter; for zones the number of the state. 0 is no limit, and the nominal
    state. The parameters are those of ``map_server``, of
    ``costmap_filter_info_server`` and of the filter in the costmaps
    (:mod:`~pgm_places.io.places.filter_masks`).

    Parameters
    ----------
    stem : Path
    topology : TopologicalMap
    kind : {"keepout", "speed-percent", "speed-m-s", "binary", "zones"}
    values : mapping of str to float, optional
        Values by class or name of place: metres per second for ``speed-m-s``, anything above 0
        switches for ``binary``, whole numbers from 0 to 100 for all others; for zones the classes'
        numbers by default.
    robot_radius_m : float
        For ``keepout``: the areas grow by as much, so that no part of the robot gets into them.
    lies_in : Path, optional
        The final folder of the files, if they are moved: Nav2 needs an absolute path.
    parameters : dict, optional
        Receives the parameters instead of a file.

    Raises
    ------
    InputError
        Values are missing, unknown or out of range.
    OutputError
        Where a file cannot be written.
    """
    from PIL import Image

    target = Path(stem)
    check_option("kind", FilterKind, kind)
    if values is None and kind != "zones":
        classes = ", ".join(topology.label_names)
        raise InputError(
            f"a {kind} mask needs values by class or place, such as room=100; classes: {classes}"
        )
    coded, multiplier = (None, 1.0) if values is None else _coded(kind, values)
    mask = mask_values(topology, coded)
    if robot_radius_m:
        mask = _grown(mask, robot_radius_m / topology.grid.resolution_m)
    content = raster_png(Image.fromarray(np.ascontiguousarray(mask[::-1])))
    image_path = write_bytes(target.with_name(f"{target.name}.png"), content)
    yaml_path = write_description(image_path, topology.grid, "raw")
    named = {number: _state_name(topology, coded, number) for number in np.unique(mask).tolist()}
    home, states = lies_in or target.parent, {s: number for number, s in named.items() if number}
    mask_yaml = home.resolve() / yaml_path.name
    nodes = filter_parameters(kind, target.name, mask_yaml, multiplier=multiplier, states=states)
    if parameters is not None:
        parameters.update(nodes)
        return [image_path, yaml_path]
    listed = yaml.safe_dump(nodes, sort_keys=False, allow_unicode=True)
    by_name = _named(topology, None) if values is None else values
    legend = ", ".join(f"{value:g} {escape_control(name)}" for name, value in by_name.items())
    text = f"# values: 0 nothing, {legend}\n{listed}"
    params_path = write_text(target.with_name(f"{target.name}_params.yaml"), text)
    return [image_path, yaml_path, params_path]


def _coded(kind: FilterKind, values: Mapping[str, float]) -> tuple[dict[str, int], float]:
    """The mask's code of each value, and the multiplier that converts codes back to values."""
    if kind == "binary":
        return {name: MOST if value > 0 else 0 for name, value in values.items()}, 1.0
    if kind.startswith("speed"):
        for name, value in values.items():
            if value <= 0:
                raise InputError(
                    f"the speed in {name!r} is {value:g}, which means no limit for Nav2; give a "
                    "speed above 0, or keep the robot out (--keep-out of 'nav2', or the export "
                    "'keepout')"
                )
    if kind == "speed-m-s":
        # In centimetres per second if they fit, so that round speeds are exact.
        factor = max(0.01, max(values.values(), default=0.0) / MOST)
        return {
            name: max(1, math.floor(value / factor * (1 + 1e-9))) for name, value in values.items()
        }, factor
    for name, value in values.items():
        if value != int(value):
            raise InputError(
                f"the mask's value of {name!r} must be a whole number from 0 to {MOST}, got "
                f"{value:g}; speed-m-s accepts fractions"
            )
    return {name: int(value) for name, value in values.items()}, 1.0


def _grown(mask: NDArray[np.uint8], radius: float) -> NDArray[np.uint8]:
    """The mask with every area grown by a radius in cells; the larger value wins."""
    from scipy.ndimage import distance_transform_edt

    grown = mask.copy()
    for value in np.unique(mask[mask > 0]).tolist():
        # A cell's square begins at most half its diagonal before its centre.
        near = distance_transform_edt(mask != value) < radius + np.sqrt(0.5)
        grown[near & (grown < value)] = value
    return grown


def _state_name(topology: TopologicalMap, values: Mapping[str, int] | None, number: int) -> str:
    """The name of a zone filter's state, from the classes or places with its value."""
    named = [name for name, value in _named(topology, values).items() if value == number]
    # Names may differ only in characters that parameters cannot have: the number makes them unique.
    return "_".join([*(re.sub(r"\W+", "_", name).strip("_") for name in named), str(number)])


def _named(topology: TopologicalMap, values: Mapping[str, int] | None) -> Mapping[str, int]:
    """Values by name: by default the classes' numbers from 1."""
    if values is not None:
        return values
    return {label: k + 1 for k, label in enumerate(topology.label_names)}
