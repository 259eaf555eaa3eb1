"""The tables of features of segments, of the cells in them, and of gates and places: definitions.

Lengths are metres, areas square metres. "Half width" is the distance to the nearest wall on the
middle line of a passage (``half_width_m``). The building is all of the map's open space.
"""

from dataclasses import dataclass

__all__ = [
    "CELL_FEATURES",
    "LARGEST_NEIGHBOUR_FEATURES",
    "SEGMENT_FEATURES",
    "SpaceSpec",
    "segment_feature_names",
]


@dataclass(frozen=True, slots=True)
class SpaceSpec:
    """One feature: its short name and its definition.

    Parameters
    ----------
    id
        Name of the feature; that of a column adds the scale: ``aspect[0.9]``.
    definition
        What it is, in metres where it has a unit.
    """

    id: str
    definition: str


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
    SpaceSpec("furniture", "share of its cells that are obstacles under 0.35 m2"),
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
    "area",
    "radius",
    "aspect",
    "filling",
    "discs",
    "openings",
    "narrow",
    "betweenness",
    "cut",
)

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
"""What a cell adds for each scale.

Its ``clearance``, the distance to the nearest wall, is the same at all scales.
"""


def segment_feature_names() -> tuple[str, ...]:
    """The names of the columns of ``segment_features``.

    Examples
    --------
    >>> names = segment_feature_names()
    >>> len(names), names[0], names[7]
    (37, 'area', 'aspect')
    """
    return tuple(spec.id for spec in SEGMENT_FEATURES)
