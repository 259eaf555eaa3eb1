"""Parameters of Nav2 for a filter mask: its servers, and the filter in the costmaps."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeAlias

__all__ = ["TYPES", "FilterKind", "filter_parameters"]

FilterKind: TypeAlias = Literal["keepout", "speed-percent", "speed-m-s", "binary", "zones"]
TYPES: dict[str, int] = {
    "keepout": 0,
    "speed-percent": 1,
    "speed-m-s": 2,
    "binary": 3,
    "zones": 4,
}
"""The number of each kind in a CostmapFilterInfo message."""

_LIMIT = "speed_limit_topic: /speed_limit"

_FILTERS: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "keepout": ("keepout_filter", "KeepoutFilter", "", ("global", "local")),
    "speed-percent": (
        "speed_filter",
        "SpeedFilter",
        _LIMIT,
        ("global",),
    ),
    "speed-m-s": ("speed_filter", "SpeedFilter", _LIMIT, ("global",)),
    "binary": (
        "binary_filter",
        "BinaryFilter",
        "binary_state_topic: /binary_state\n        flip_threshold: 50.0",
        ("global",),
    ),
    "zones": ("zone_filter", "ZoneParameterFilter", "", ("local",)),
}
"""Name, plugin and output of each filter, and the costmaps that it belongs in."""


def filter_parameters(
    kind: FilterKind,
    name: str,
    mask_yaml: Path,
    *,
    multiplier: float = 1.0,
    states: Mapping[str, int] | None = None,
) -> str:
    """The text of a parameter file.

    It holds the parameters of ``map_server`` (as ``filter_mask_server``) and of
    ``costmap_filter_info_server``, and a block ``filters`` for the costmaps that names their
    topics. A costmap with filters of its own needs them all in one list.

    Parameters
    ----------
    kind : {"keepout", "speed-percent", "speed-m-s", "binary", "zones"}
    name : str
        Of the mask: its topics are called ``/NAME_mask`` and ``/NAME_mask_info``.
    mask_yaml : Path
        The mask's YAML file. The server resolves a relative path against the folder that it was
        started in, so this should be absolute.
    multiplier : float
        The filter sees ``multiplier * value``.
    states : mapping of str to int, optional
        For zones, the value of each state in the mask. All must be listed: the filter stops the
        robot at a value that it does not know. None has ``setpoints``, as ROS cannot read an empty
        list; the filter says so and goes on.

    Examples
    --------
    >>> print(filter_parameters("keepout", "keepout", Path("/maps/keepout.yaml")))
    filter_mask_server:
      ros__parameters:
        topic_name: "/keepout_mask"
        yaml_filename: "/maps/keepout.yaml"
    costmap_filter_info_server:
      ros__parameters:
        type: 0
        filter_info_topic: "/keepout_mask_info"
        mask_topic: "/keepout_mask"
        base: 0.0
        multiplier: 1.0
    global_costmap:
      global_costmap:
        ros__parameters:
          filters: ["keepout_filter"]
          keepout_filter:
            plugin: "nav2_costmap_2d::KeepoutFilter"
            enabled: true
            filter_info_topic: "/keepout_mask_info"
    local_costmap:
      local_costmap:
        ros__parameters:
          filters: ["keepout_filter"]
          keepout_filter:
            plugin: "nav2_costmap_2d::KeepoutFilter"
            enabled: true
            filter_info_topic: "/keepout_mask_info"
    <BLANKLINE>
    """
    topic = f"/{name.replace('-', '_')}_mask"
    lines = [
        "filter_mask_server:",
        "  ros__parameters:",
        f'    topic_name: "{topic}"',
        f'    yaml_filename: "{mask_yaml}"',
        "costmap_filter_info_server:",
        "  ros__parameters:",
        f"    type: {TYPES[kind]}",
        f'    filter_info_topic: "{topic}_info"',
        f'    mask_topic: "{topic}"',
        "    base: 0.0",
        f"    multiplier: {float(multiplier)!r}",
    ]
    filter_name, plugin, output, costmaps = _FILTERS[kind]
    for costmap in costmaps:
        lines += [
            f"{costmap}_costmap:",
            f"  {costmap}_costmap:",
            "    ros__parameters:",
            f'      filters: ["{filter_name}"]',
            f"      {filter_name}:",
            f'        plugin: "nav2_costmap_2d::{plugin}"',
            "        enabled: true",
            f'        filter_info_topic: "{topic}_info"',
            *([f"        {output}"] if output else []),
            *(_states(states or {}) if kind == "zones" else []),
        ]
    if output.startswith("speed_limit"):
        lines += ["controller_server:", "  ros__parameters:", f"    {output}"]
    return "\n".join(lines) + "\n"


def _states(states: Mapping[str, int]) -> list[str]:
    listed = ", ".join(f'"{state}"' for state in states)
    return [
        *([f"        states: [{listed}]"] if states else []),
        *(f"        {state}:\n          id: {value}" for state, value in states.items()),
    ]
