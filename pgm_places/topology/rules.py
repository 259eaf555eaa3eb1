"""Options of topological maps: which regions count as errors, and which corrections are made."""

from dataclasses import dataclass
from typing import Literal

from pgm_places.options import AtLeastZero, check_options

__all__ = ["CorrectionRules", "DoorwaysFrom", "TopologyOptions"]

DoorwaysFrom = Literal["gates", "labels"]


@dataclass(frozen=True)
class CorrectionRules:
    """Which regions count as classification errors.

    Parameters
    ----------
    min_area_m2 : float
        Minimum area of a room or corridor (m²); smaller ones are errors (the paper: 1 m²).
    min_doorway_area_m2 : float
        Minimum area of a doorway (m²); smaller ones are errors (the paper: 0.1 m²).
    doorways_join_two : bool
        Relabel doorways that touch fewer than two regions.
    doorway_label : str
        Name of the label that marks doorways.
    widest_doorway_m : float
        Relabel doorway cells wider than this (m); 0 keeps them. Not in the paper.
    close_leaks_m : float
        Extend leaking doorways from wall to wall up to this width (m); 0 extends none. Not in the
        paper.
    split_rooms_m : float
        Split places at constrictions narrower than this (m); 0 splits none. Not in the paper.
    min_part_m2 : float
        Minimum area of both parts that remain after closing a leak or splitting a place (m²).
    """

    min_area_m2: AtLeastZero = 1.0
    min_doorway_area_m2: AtLeastZero = 0.1
    doorways_join_two: bool = True
    doorway_label: str = "doorway"
    widest_doorway_m: AtLeastZero = 0.0
    close_leaks_m: AtLeastZero = 0.0
    split_rooms_m: AtLeastZero = 0.0
    min_part_m2: AtLeastZero = 4.0

    def __post_init__(self) -> None:
        check_options(self)


@dataclass(frozen=True)
class TopologyOptions(CorrectionRules):
    """The rules, whether they are applied, and which passages connect places.

    Parameters
    ----------
    correct : bool
        Correct erroneous regions.
    min_width_m : float
        Passages narrower than this (m) connect nothing.
    doorways : {"gates", "labels"}
        Which doorways part places: the accepted gates of the map, where the model finds any, or
        the cells labelled as doorways.
    """

    correct: bool = True
    min_width_m: AtLeastZero = 0.0
    doorways: DoorwaysFrom = "gates"
