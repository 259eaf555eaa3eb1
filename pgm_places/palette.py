"""Colours of labels in all pictures, distinguishable with colour blindness and in grey."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WALL = "#2d2d2d"
UNKNOWN = "#dcdcdc"
IGNORED, IGNORED_STRIPE = "#ffffff", "#ededed"
"""Free cells without a label: white with light stripes."""

ERROR = "#d1002c"
RIGHT_TINT = 0.25
"""The share of a label's colour that marks a right answer in difference pictures."""

RESERVED = {"corridor": 0, "room": 1, "doorway": 2, "door": 2}
"""Labels with reserved colours, independent of their index."""

LABEL_COLOURS = (
    "#f4c150",
    "#5b93c5",
    "#a6336c",
    "#6d6108",
    "#2b4bb8",
    "#700967",
    "#d47e8e",
    "#a1de96",
    "#9980f7",
    "#6ed9fb",
    "#154816",
    "#9d9b46",
)
"""Twelve colours, pairwise and against walls, white and unknown at least 21 apart in CIE 1976 Lab,
for normal sight and for simulated protanopia, deuteranopia and tritanopia alike. The lightness of
the first three is 81, 59 and 41, so corridors, rooms and doorways differ on a grey printer too."""

_PROBABILITY = ("#f7fbff", "#c6dbef", "#6baed6", "#2171b5", "#08306b")
_ENTROPY = ("#fff7ec", "#fdd49e", "#fc8d59", "#d7301f", "#7f0000")
_GRADIENTS = {"probability": _PROBABILITY, "entropy": _ENTROPY}


@dataclass(frozen=True)
class Swatch:
    """An entry of a legend: a colour, optionally hatched, and its text."""

    name: str
    colour: str
    hatched: bool = False


GROUND_SWATCHES = (
    Swatch("occupied", WALL),
    Swatch("unknown", UNKNOWN),
    Swatch("free, no label", IGNORED, hatched=True),
)


def rgb_of(colour: str) -> NDArray[np.uint8]:
    """(3,) red, green and blue of ``#rrggbb``."""
    return np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)], np.uint8)


def hex_of(rgb: Sequence[int] | NDArray[np.uint8]) -> str:
    """``#rrggbb`` of red, green and blue."""
    return "#" + "".join(f"{int(part):02x}" for part in rgb)


def tinted(colour: str, share: float) -> str:
    """A mixture of the colour, with the weight ``share``, and white."""
    return hex_of(np.round(255 - share * (255 - rgb_of(colour).astype(float))).astype(np.uint8))


def label_colours(label_names: Sequence[str]) -> tuple[str, ...]:
    """A colour per label: reserved ones by name, the others in turn; darker from the 13th on.

    Examples
    --------
    >>> label_colours(["room", "kitchen"]) == (LABEL_COLOURS[1], LABEL_COLOURS[3])
    True
    """
    fixed = {name: RESERVED[name.lower()] for name in label_names if name.lower() in RESERVED}
    # Reserved colours go to other labels only where nothing else is left.
    others = [*range(3, len(LABEL_COLOURS)), *range(3)]
    free = [index for index in others if index not in fixed.values()]
    colours, taken = [], 0
    for name in label_names:
        if name in fixed:
            colours.append(LABEL_COLOURS[fixed[name]])
            continue
        turn, index = divmod(taken, len(free))
        colours.append(_darker(LABEL_COLOURS[free[index]], 0.65**turn))
        taken += 1
    return tuple(colours)


def label_swatches(label_names: Sequence[str]) -> tuple[Swatch, ...]:
    """The labels with their colours, in order."""
    return tuple(map(Swatch, label_names, label_colours(label_names)))


def _darker(colour: str, share: float) -> str:
    return hex_of(np.round(share * rgb_of(colour)).astype(np.uint8))


def levels(gradient: str, n_levels: int) -> tuple[str, ...]:
    """Colours from low to high of the gradient ``"probability"`` or ``"entropy"``."""
    anchors = np.array([rgb_of(colour) for colour in _GRADIENTS[gradient]], float)
    at = np.linspace(0, len(anchors) - 1, n_levels)
    mixed = [np.interp(at, np.arange(len(anchors)), anchors[:, part]) for part in range(3)]
    return tuple(hex_of(row) for row in np.round(np.stack(mixed, axis=1)).astype(np.uint8))
