"""Styles of buildings: sizes of corridors, rooms and doors, and typical kinds of buildings."""

from dataclasses import dataclass, replace
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
    """Space for rooms along a corridor."""


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


# Rooms and corridors of 13 office and 28 school floors, measured in November 2026;
# quantiles at 10, 20, 40, 50, 60, 80, 90 %, in metres:
#
#                  |            offices               |             schools
#   longer side    | 3.2  4.4  5.2  5.6  6.1  7.8  9.2 | 3.1  4.3  6.5  7.4  8.1  9.5 11.7
#   shorter side   | 2.3  3.0  4.0  4.3  4.5  5.3  6.4 | 2.0  2.6  3.9  5.0  6.3  7.5  8.4
#   corridor width | 1.6  1.8  2.0  2.2  2.4  3.0  3.9 | 1.7  2.1  2.5  2.8  3.1  3.5  4.0
#
# One span of `fronts_cm` is drawn for each room, so that spans between quantiles of equal distance
# give the measured distribution. Longer and shorter side are along the corridor about as often.
# There are 0.12 to 0.26 (0.13 to 0.32) rooms for each metre of corridor, 1.05 to 1.3 (1.1 to 1.9)
# doors for each room, and 22 to 38 (16 to 33) % of the area is corridor or hall. Their door widths
# are assumed, not measured. The sizes of the other kinds are the author's judgement.
_MEASURED_FRONTS: tuple[Span, ...] = ((230, 300), (300, 400), (400, 450), (450, 560), (560, 780))
_SCHOOL_FRONTS: tuple[Span, ...] = ((260, 390), (390, 630), (630, 750), (740, 860), (860, 1170))
_OFFICE_CORRIDORS: tuple[Span, ...] = ((160, 180), (180, 200), (200, 240), (240, 300), (300, 390))
_SCHOOL_CORRIDORS: tuple[Span, ...] = ((170, 210), (210, 250), (250, 310), (310, 350), (350, 400))
_PLAIN_DOORS: tuple[Span, ...] = ((80, 100), (85, 95), (90, 120))

_SCHOOL = Style(
    rooms_cm=RoomSizes(_SCHOOL_FRONTS, 250, (390, 750), (500, 850), 900),
    layouts=("bar", "comb", "comb", "court", "ladder", "foyer"),
    halls=(0, 2),
    large_room_cm=((1300, 2400), (1100, 1700)),
    inner_rooms=(1, 3),
)
_UNIVERSITY = Style(
    rooms_cm=RoomSizes(
        (*OFFICE.rooms_cm.fronts, (600, 900), (900, 1400)), 270, (430, 600), (550, 900), 950
    ),
    layouts=("bar", "comb", "ladder", "court", "foyer"),
    halls=(0, 2),
    large_room_cm=((1000, 1800), (900, 1500)),
)
_CLINIC = Style(
    rooms_cm=RoomSizes(
        ((240, 320), (300, 380), (350, 450), (500, 700)), 230, (380, 560), (450, 650), 700
    ),
    side_door_cm=(80, 120),
    layouts=("bar", "comb", "ladder", "ladder", "court"),
    halls=(1, 3),
    inner_rooms=(1, 4),
)
_HOTEL = Style(
    rooms_cm=RoomSizes(((330, 390), (340, 420), (360, 460)), 300, (560, 760), (560, 760), 820),
    layouts=("bar", "bar", "comb", "court"),
    halls=(0, 1),
    inner_rooms=(7, 8),
)
_HALL = Style(
    rooms_cm=RoomSizes(_MEASURED_FRONTS, 240, (300, 560), (450, 780), 820),
    layouts=("foyer",),
    halls=(0, 2),
    inner_rooms=(1, 6),
)
_HOME = Style(
    rooms_cm=RoomSizes(
        ((160, 240), (250, 340), (300, 420), (380, 560)), 150, (240, 460), (300, 520), 560
    ),
    side_door_cm=(75, 140),
    layouts=("bar",),
    inner_rooms=(1, 8),
    side_doors=(1, 3),
    length_percent=(12, 25),
)
_MALL = Style(
    rooms_cm=RoomSizes(((450, 700), (600, 1000), (900, 1600)), 400, (500, 1100), (800, 1600), 1700),
    layouts=("bar", "comb", "court"),
    halls=(0, 2),
    inner_rooms=(1, 4),
    side_doors=(1, 12),
)
_MUSEUM = Style(
    rooms_cm=RoomSizes(((500, 900), (700, 1200), (900, 1600)), 450, (500, 900), (600, 1400), 1450),
    side_door_cm=(110, 260),
    layouts=("foyer", "foyer", "bar", "court"),
    halls=(0, 1),
    large_room_cm=((1000, 2000), (900, 1600)),
    side_doors=(3, 4),
)
_RING = Style(
    rooms_cm=RoomSizes(_MEASURED_FRONTS, 240, (390, 560), (450, 780), 820),
    layouts=("ladder", "court"),
    halls=(0, 1),
    inner_rooms=(1, 6),
)
_OPEN_PLAN = Style(
    rooms_cm=RoomSizes(((300, 500), (800, 1400), (1200, 2200)), 280, (400, 560), (800, 1200), 1260),
    side_door_cm=(90, 180),
    layouts=("bar", "ladder", "foyer"),
    halls=(0, 2),
)
_SUITE = Style(
    rooms_cm=RoomSizes(((300, 450), (900, 1600), (1500, 3000)), 280, (350, 560), (760, 1300), 1350),
    layouts=("bar", "comb", "ladder", "foyer"),
    halls=(0, 2),
    side_doors=(0, 1),
    doors_apart_cm=600,
    back_rooms=(1, 2),
)
_CELLS = Style(
    rooms_cm=RoomSizes(((200, 260), (230, 300), (260, 340)), 190, (260, 420), (300, 450), 500),
    side_door_cm=(70, 80),
    layouts=("bar", "comb", "ladder", "ladder"),
    halls=(0, 1),
)
_APARTMENT = Style(
    rooms_cm=RoomSizes(
        ((150, 220), (220, 310), (280, 400), (350, 560)), 150, (200, 400), (280, 480), 520
    ),
    side_door_cm=(75, 200),
    layouts=("flat",),
    large_room_cm=((300, 560), (300, 520)),
    side_doors=(1, 3),
    length_percent=(8, 13),
    vacant=(0, 1),
    openings=(1, 3),
    opening_cm=(80, 200),
    growth_cm=220,
    large_furniture=1000,
    doorway_margin_cm=15,
)
_ATRIUM = Style(
    rooms_cm=RoomSizes((*_MEASURED_FRONTS, (600, 1000)), 240, (300, 600), (450, 900), 950),
    layouts=("atrium",),
    vacant=(1, 3),
    openings=(1, 12),
    opening_cm=(140, 250),
    pilasters=(1, 4),
    large_furniture=500,
)
_LAB = Style(
    rooms_cm=RoomSizes(((280, 400), (600, 1000), (800, 1600)), 260, (350, 600), (600, 1300), 1350),
    layouts=("bar", "bar", "comb", "passage"),
    halls=(0, 1),
    side_doors=(1, 4),
    length_percent=(25, 80),
    doors_apart_cm=800,
    back_rooms=(1, 3),
    vacant=(1, 6),
    pilasters=(1, 2),
    large_furniture=1200,
)
_PASSAGE = Style(
    rooms_cm=RoomSizes((*_MEASURED_FRONTS, (600, 1200)), 240, (300, 600), (450, 900), 950),
    layouts=("passage",),
    halls=(0, 1),
    length_percent=(40, 110),
    vacant=(1, 2),
    pilasters=(1, 2),
    large_furniture=300,
)

KINDS: dict[str, tuple[Style, tuple[Span, ...], tuple[Span, ...]]] = {
    "cells": (_CELLS, ((120, 160), (150, 200), (180, 240)), ((70, 85), (75, 90))),
    "clinic": (_CLINIC, ((180, 220), (210, 260), (240, 320)), ((90, 130), (110, 140))),
    "hall": (_HALL, _OFFICE_CORRIDORS, _PLAIN_DOORS),
    "home": (_HOME, ((90, 120), (110, 150), (140, 200)), ((70, 85), (75, 95))),
    "hotel": (_HOTEL, ((140, 170), (150, 190), (170, 220)), ((80, 95),)),
    "mall": (_MALL, ((450, 650), (600, 900), (800, 1200)), ((100, 180), (150, 300))),
    "museum": (_MUSEUM, ((200, 300), (260, 400), (350, 600)), ((110, 160), (140, 260))),
    "open-plan": (_OPEN_PLAN, _OFFICE_CORRIDORS, ((90, 120), (100, 200))),
    "ring": (_RING, _OFFICE_CORRIDORS, _PLAIN_DOORS),
    "school": (_SCHOOL, _SCHOOL_CORRIDORS, ((85, 100), (90, 120), (100, 170))),
    "suite": (_SUITE, _OFFICE_CORRIDORS, _PLAIN_DOORS),
    "apartment": (_APARTMENT, ((90, 110), (100, 130), (120, 150)), ((70, 85), (75, 95))),
    "atrium": (_ATRIUM, _OFFICE_CORRIDORS, ((85, 100), (90, 120), (100, 170))),
    "lab": (_LAB, ((180, 240), (220, 300), (280, 400)), ((85, 100), (90, 120), (100, 170))),
    "passage": (_PASSAGE, ((160, 240), (220, 350), (300, 600)), ((85, 100), (90, 120))),
    "university": (_UNIVERSITY, ((160, 210), (200, 260), (240, 320)), _PLAIN_DOORS),
}
"""Style, widths of corridors and widths of doors of each kind; one width of each is drawn for a
building, since all its corridors and doors are alike."""


def style_of_kind(dice: Dice, kind: str) -> Style:
    """The style of one building of a kind."""
    style, corridors, doors = KINDS[kind]
    corridor, other = dice.choice(corridors), dice.choice(corridors)
    door = dice.choice(doors)
    return replace(style, corridor_cm=corridor, branch_cm=other, link_cm=other, door_cm=door)
