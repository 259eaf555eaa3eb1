"""Options of topological maps: which regions count as errors, and which corrections are made."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pgm_places.errors import ConfigError, quoted
from pgm_places.options import AtLeastZero, Options, from_mapping

DoorwaysFrom = Literal["gates", "labels"]

# Corrections by width of earlier versions, off by default; replaced by gates.
_RETIRED = ("widest_doorway_m", "close_leaks_m", "split_rooms_m")


@dataclass(frozen=True)
class CorrectionRules(Options):
    """Which regions count as classification errors.

    Parameters
    ----------
    min_area_m2 : float
        Minimum area of a room or corridor (m²); smaller ones are errors (the paper: 1 m²).
    min_doorway_area_m2 : float
        Minimum area of a doorway (m²); smaller ones are errors (the paper: 0.1 m²).
    min_clearance_m : float
        Radius of a disc that a room or corridor must have room for (m); where it fits nowhere, the
        region is an error. 0 for no minimum; ``label``, ``live`` and the studio use the robot's
        (``disc_radius_m`` of :class:`~pgm_places.spaces.entered_options.EnteredOptions`).
    doorways_join_two : bool
        Relabel doorways that touch fewer than two regions.
    doorway_label : str
        Name of the label that marks doorways.
    """

    min_area_m2: AtLeastZero = 1.0
    min_doorway_area_m2: AtLeastZero = 0.1
    min_clearance_m: AtLeastZero = 0.0
    doorways_join_two: bool = True
    doorway_label: str = "doorway"


@dataclass(frozen=True)
class TopologyOptions(CorrectionRules):
    """Options of topological maps: whether regions are corrected, and what connects places.

    Parameters
    ----------
    correct : bool
        Correct erroneous regions.
    min_width_m : float
        Passages narrower than this (m) connect nothing.
    doorways : {"gates", "labels"}
        Separators of places: the accepted gates of the map, if the model finds any, or cells
        labelled as doorways.
    """

    correct: bool = True
    min_width_m: AtLeastZero = 0.0
    doorways: DoorwaysFrom = "gates"


def stored_options(values: Any, *, path: str) -> TopologyOptions:
    """The options in a file of this or an earlier version.

    ConfigError: an option is unknown, or a correction of an earlier version is switched on.
    """
    if not isinstance(values, Mapping):
        return from_mapping(TopologyOptions, values, path=path)
    for name in _RETIRED:
        if values.get(name):
            raise ConfigError(
                f"{path}.{name} is {quoted(values[name])}, but doorways are no longer corrected by "
                "width: gates separate places now; set it to 0 in the file"
            )
    current = {key: value for key, value in values.items() if key not in (*_RETIRED, "min_part_m2")}
    return from_mapping(TopologyOptions, current, path=path)
