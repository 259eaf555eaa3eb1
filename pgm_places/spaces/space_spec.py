"""Definitions of the features of segments, their cells, gates and places.

Lengths are metres, areas square metres. "Half width" is the distance to the nearest wall on the
middle line of a passage (``half_width_m``). The building is all of the map's open space.
"""

import hashlib
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SpaceSpec:
    """One feature: its short name and its definition."""

    id: str  # name of the feature; the name of a column adds the scale: ``aspect[0.9]``
    definition: str  # the definition; lengths in metres


SHAPE_FEATURES: tuple[SpaceSpec, ...] = (
    SpaceSpec("area", "area of the segment"),
    SpaceSpec("radius", "half width at its widest: the radius of the largest disc in it"),
    SpaceSpec("clearance", "mean distance of its cells to the nearest wall"),
    SpaceSpec("clearance_share", "clearance / radius"),
    SpaceSpec("roundness", "root of the smaller over the larger second central moment"),
    SpaceSpec("short", "shorter side of the smallest rectangle around it, over 15 orientations"),
    SpaceSpec("long", "longer side of that rectangle"),
    SpaceSpec("aspect", "short / long"),
    SpaceSpec("filling", "area / (short long)"),
    SpaceSpec("discs", "area / (pi radius^2): how many of its largest discs it holds"),
    SpaceSpec("unknown", "share of its outline at unknown cells"),
    SpaceSpec("furniture", "share of its cells that are obstacles under 0.35 m2 and 1.3 m"),
)

OPENING_FEATURES: tuple[SpaceSpec, ...] = (
    SpaceSpec("openings", "number of its openings to other segments"),
    SpaceSpec("narrow", "number of those with a half width under 0.8 m"),
    SpaceSpec("widest", "half width of the widest opening, 0 where there is none"),
    SpaceSpec("widest_share", "widest / radius"),
    SpaceSpec("opening_density", "openings / root of area"),
    SpaceSpec("narrow_density", "narrow / long"),
    SpaceSpec("open_share", "share of its outline that is open"),
)

POSITION_FEATURES: tuple[SpaceSpec, ...] = (
    SpaceSpec("rank", "share of the building's area in segments no larger than it"),
    SpaceSpec("radius_share", "radius / the building's median radius, weighted by area"),
    SpaceSpec("long_share", "long / root of the building's area"),
    SpaceSpec("betweenness", "share of the shortest paths between other segments through it"),
    SpaceSpec("cut", "share of the other area that it cuts off from the largest part"),
    SpaceSpec("neighbour_area", "mean area of its neighbours, 0 where there is none"),
    SpaceSpec("neighbour_share", "summed area of its neighbours / area"),
    SpaceSpec("neighbour_betweenness", "largest betweenness of its neighbours"),
    SpaceSpec("neighbour_cut", "largest cut of its neighbours"),
)

_OF_LARGEST = (
    "area", "radius", "aspect", "filling", "discs", "openings", "narrow", "betweenness", "cut",
)  # fmt: skip

OWN_FEATURES = (*SHAPE_FEATURES, *OPENING_FEATURES, *POSITION_FEATURES)

LARGEST_NEIGHBOUR_FEATURES: tuple[SpaceSpec, ...] = tuple(
    SpaceSpec(f"largest_{id}", f"{id} of its largest neighbour, 0 where there is none")
    for id in _OF_LARGEST
)

SEGMENT_FEATURES: tuple[SpaceSpec, ...] = (*OWN_FEATURES, *LARGEST_NEIGHBOUR_FEATURES)
"""The 37 features of a segment in the order of their columns."""

CELL_FEATURES: tuple[SpaceSpec, ...] = (
    SpaceSpec("depth", "distance to the nearest wall / radius of its segment"),
    SpaceSpec("way_out", "distance to the nearest opening of its segment, at most 10"),
    SpaceSpec("way_out_width", "half width of that opening, 0 where there is none"),
)
"""Features of a cell at each scale.

Its ``clearance``, the distance to the nearest wall, is the same at all scales.
"""


_SIDES = (
    "area", "radius", "clearance_share", "roundness", "long", "aspect", "filling", "discs",
    "openings", "narrow", "open_share", "betweenness", "cut", "radius_share", "furniture",
)  # fmt: skip

GATE_SHAPE_FEATURES: tuple[SpaceSpec, ...] = (
    SpaceSpec("half_width", "half width at the saddle of its gap"),
    SpaceSpec("width", "length of the shortest of 24 chords of free cells through its middle"),
    SpaceSpec("depth", "how far the passage is at most 1.25 width + 0.1 wide, at most 3.1"),
    SpaceSpec("border", "extent of the border in its gap"),
    SpaceSpec("saddle_to_small", "half_width / radius of the narrower side"),
    SpaceSpec("saddle_to_large", "half_width / radius of the wider side"),
    SpaceSpec("width_to_small", "width / (2 radius of the narrower side)"),
    SpaceSpec("width_to_large", "width / (2 radius of the wider side)"),
    SpaceSpec("tilt", "|sin 2a| of its heading a against the map's rows: 0 along either axis"),
    SpaceSpec("nearest_gate", "distance to the nearest other candidate, at most 10"),
    SpaceSpec("gates_near", "number of other candidates within 3 m"),
    SpaceSpec("gaps", "number of candidates between the same two segments"),
    SpaceSpec("parted_0.75", "1 where the second scale parts its sides, else 0"),
    SpaceSpec("parted_0.6", "1 where the third scale parts its sides, else 0"),
)

GATE_FEATURES: tuple[SpaceSpec, ...] = (
    *GATE_SHAPE_FEATURES,
    *(SpaceSpec(f"small_{id}", f"{id} of the side of the smaller radius") for id in _SIDES),
    *(SpaceSpec(f"large_{id}", f"{id} of the side of the larger radius") for id in _SIDES),
    *(
        SpaceSpec(f"width[{tenth / 10:g}]", "width of the free space that far before or behind")
        for tenth in range(-15, 16)
    ),
)
"""The 75 features of a gate. Widths run from the narrower side (-1.5 m) to the wider one (1.5 m)
and are at most 6."""

PLACE_EXTRA_FEATURES: tuple[SpaceSpec, ...] = (
    SpaceSpec("gates", "number of accepted gates to other places"),
    SpaceSpec("gate_density", "gates / root of area"),
    SpaceSpec("gates_along", "gates / long"),
    SpaceSpec("one_gate", "number of gates that lead to places with no other gate"),
    SpaceSpec("one_gate_density", "one_gate / root of area"),
    SpaceSpec("one_gate_share", "one_gate / gates, 0 where there is none"),
)

PLACE_FEATURES: tuple[SpaceSpec, ...] = (*SEGMENT_FEATURES, *PLACE_EXTRA_FEATURES)
"""The 43 features of a place between accepted gates: those of a segment and six more."""


EARLIER_SPACE_FEATURES = frozenset(
    {"16c75677abdf46a8f6138b08322a2797de1e21ec9ce817813fb3e7816029f8a8"}
)
"""Digests of earlier definitions whose models can be read. Up to 0.4, thin pieces of wall counted
as furniture; lists trained then are as accurate on today's gates."""

_DEFINITIONS_VERSION = 1  # incremented if a definition changes but its text does not


def space_features_hash() -> str:
    """Hexadecimal digest that changes with the columns, their order or their definitions."""
    specs = (*PLACE_FEATURES, *CELL_FEATURES, *GATE_FEATURES)
    lines = [f"{spec.id}: {spec.definition}" for spec in specs]
    return hashlib.sha256("\n".join((str(_DEFINITIONS_VERSION), *lines)).encode()).hexdigest()
