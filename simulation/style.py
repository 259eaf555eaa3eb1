"""The style of a building: widths of corridors, sizes of rooms and doors."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from pgm_places.simulation.portable_random import Dice

StyleName = Literal[
    "office", "varied", "cells", "clinic", "hall", "home", "hotel", "mall", "museum", "open-plan",
    "ring", "school", "suite", "university", "apartment", "atrium", "lab", "passage",
]  # fmt: skip
"""Offices, offices with other widths and sizes, and kinds of buildings."""

Span = tuple[int, int]
"""Smallest and largest length in centimetres."""


class RoomSizes(NamedTuple):
    """How large rooms are, in centimetres."""

    fronts: tuple[Span, ...]
    """Kinds of room by their length along the corridor; one is chosen for each room."""
    narrowest: int
    """The least length along the corridor that a room needs."""
    small_depth: Span
    """How far rooms of less than 5 m along the corridor reach away from it,"""
    large_depth: Span
    """and those of more."""
    deepest: int
    """Space for rooms beside a corridor."""


_OFFICE_FRONTS = ((280, 360), (300, 420), (320, 420), (450, 640), (650, 900))
_OFFICE_ROOMS = RoomSizes(_OFFICE_FRONTS, 270, (380, 600), (520, 700), 720)


@dataclass(frozen=True)
class Style:
    """Lengths in centimetres from which a building's parts are drawn.

    Parameters
    ----------
    corridor_cm, branch_cm, link_cm : (int, int)
        Width of a wing's main corridor, of one that branches off, of one that joins two.
    rooms_cm : RoomSizes
    door_cm, side_door_cm : (int, int)
        Width of the doors to the corridor, and of those between rooms.
    height_cm : int or None
        Extent of the building across its wings; None for that of its size.
    layouts : tuple of str
        The ways in which corridors may run (:data:`pgm_places.simulation.layout.LAYOUTS`); none for
        a building of wings.
    halls : (int, int)
        How many halls lie along the corridors.
    large_room_cm : ((int, int), (int, int)) or None
        Length and width of a gym or a lecture theatre at a corridor's end, if there may be one.
    inner_rooms : (int, int)
        Share of rooms with a washroom or a store, as (numerator, denominator).
    side_doors : (int, int)
        Share of rooms with a door to the previous one, as (numerator, denominator).
    length_percent : (int, int)
        Length of the corridors, in per cent of that of the wings.
    doors_apart_cm : int or None
        The distance between the doors of a large room; one or two doors by default.
    back_rooms : (int, int) or None
        Share of large rooms with smaller ones at their back wall, as a fraction; none by default.
    vacant : (int, int)
        Share of rooms left out (shafts, staircases, locked rooms), as (numerator, denominator).
    openings : (int, int) or None
        Share of doors to the corridor that are cased openings without leaves, as a fraction; none
        by default.
    opening_cm : (int, int)
        Width of such openings; less where the room is narrower.
    pilasters : (int, int) or None
        Share of corridors with pilasters and alcoves between them, as a fraction; none by default.
    growth_cm : int
        Greatest enlargement of rooms into free space.
    large_furniture : int
        Amount of furniture that looks like walls, in thousandths.
    doorway_margin_cm : int
        Reach of a doorway before and behind its wall.
    """

    corridor_cm: Span = (165, 250)
    branch_cm: Span = (160, 220)
    link_cm: Span = (160, 200)
    rooms_cm: RoomSizes = _OFFICE_ROOMS
    door_cm: Span = (80, 110)
    side_door_cm: Span = (80, 100)
    height_cm: int | None = None
    layouts: tuple[str, ...] = ()
    halls: Span = (0, 0)
    large_room_cm: tuple[Span, Span] | None = None
    inner_rooms: tuple[int, int] = (0, 1)
    side_doors: tuple[int, int] = (1, 4)
    length_percent: Span = (60, 110)
    doors_apart_cm: int | None = None
    back_rooms: tuple[int, int] | None = None
    vacant: tuple[int, int] = (1, 12)
    openings: tuple[int, int] | None = None
    opening_cm: Span = (80, 200)
    pilasters: tuple[int, int] | None = None
    growth_cm: int = 500
    large_furniture: int = 0
    doorway_margin_cm: int = 30


OFFICE = Style()
"""The floor of an office building, as the real ones in the literature are."""

_CORRIDORS = ((120, 160), (150, 200), (165, 250), (220, 300), (280, 380))
_FRONTS = (
    ((220, 300), (250, 340), (280, 400)),  # cells, single bedrooms
    OFFICE.rooms_cm.fronts,
    ((300, 420), (450, 640), (650, 900), (800, 1300)),
    ((600, 900), (800, 1200), (1000, 1600)),  # laboratories, classrooms
)
_DEPTHS = (
    ((300, 450), (420, 600)),
    (OFFICE.rooms_cm.small_depth, OFFICE.rooms_cm.large_depth),
    ((450, 700), (600, 1050)),
)
_DOORS = ((70, 85), (80, 110), (90, 130), (110, 180))


def draw_style(dice: Dice) -> Style:
    """A building's style, drawn: narrow or wide corridors, cells or halls, single or double doors.

    Each length is drawn on its own, since nothing ties the width of a corridor to that of a door.
    """
    corridor, other = dice.choice(_CORRIDORS), dice.choice(_CORRIDORS)
    small, large = dice.choice(_DEPTHS)
    fronts, doors = dice.choice(_FRONTS), dice.choice(_DOORS)
    deepest = large[1] + 80
    return Style(
        corridor_cm=corridor,
        branch_cm=other,
        link_cm=other,
        rooms_cm=RoomSizes(fronts, fronts[0][0] - 10, small, large, deepest),
        door_cm=doors,
        side_door_cm=dice.choice(_DOORS[:3]),
        height_cm=2400 + 2 * max(0, deepest - OFFICE.rooms_cm.deepest) + corridor[1] - 250,
    )
