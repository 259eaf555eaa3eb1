from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.palette import (
    IGNORED,
    LABEL_COLOURS,
    UNKNOWN,
    WALL,
    hex_of,
    label_colours,
    levels,
    rgb_of,
    tinted,
)

# Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
SIGHT = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


def lab(colour: str, sight: str) -> NDArray[np.float64]:
    rgb = rgb_of(colour) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(SIGHT[sight] @ linear, 0, 1)
    xyz = XYZ @ seen / np.array([0.95047, 1.0, 1.08883])
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", SIGHT)
def test_all_colours_of_a_map_are_told_apart(sight: str) -> None:
    seen = {colour: lab(colour, sight) for colour in (*LABEL_COLOURS, WALL, UNKNOWN, IGNORED)}
    apart = {
        pair: float(np.linalg.norm(seen[pair[0]] - seen[pair[1]]))
        for pair in combinations(seen, 2)
        if set(pair) != {UNKNOWN, IGNORED}
    }
    closest = min(apart, key=lambda pair: apart[pair])
    assert apart[closest] > 21, closest


def test_corridor_room_and_doorway_differ_in_grey() -> None:
    lightness = sorted(lab(colour, "normal")[0] for colour in LABEL_COLOURS[:3])
    assert np.diff(lightness).min() > 18


@pytest.mark.parametrize(
    "names",
    [
        ("corridor", "room", "doorway"),
        ("doorway", "corridor", "room"),
        ("Room", "x", "CORRIDOR", "doorway"),
    ],
)
def test_known_labels_keep_their_colour_in_any_order(names: tuple[str, ...]) -> None:
    found = {name.lower(): colour for name, colour in zip(names, label_colours(names), strict=True)}
    assert (found["corridor"], found["room"], found["doorway"]) == LABEL_COLOURS[:3]


@pytest.mark.parametrize("n_labels", [1, 2, 12, 13, 30])
def test_every_label_has_a_colour_of_its_own(n_labels: int) -> None:
    colours = label_colours([f"label {k}" for k in range(n_labels)])
    assert len(set(colours)) == n_labels


def test_colours_go_to_numbers_and_back() -> None:
    assert hex_of(rgb_of("#0a1bff")) == "#0a1bff"
    assert tinted("#000000", 0.0) == "#ffffff"
    assert tinted("#123456", 1.0) == "#123456"


@pytest.mark.parametrize("gradient", ["probability", "entropy"])
def test_gradients_darken_steadily(gradient: str) -> None:
    lightness = [lab(colour, "normal")[0] for colour in levels(gradient, 24)]
    assert (np.diff(lightness) < 0).all()
