"""The picture of the networks that see the whole floor."""

import numpy as np

from experiments.pictures.kept import (
    at,
    crop,
    draw_ground,
    draw_labels,
    figure,
    keep,
    plain,
    shipped,
)
from experiments.pictures.maps import DOUBT
from pgm_places import LabelledMap, label_map
from pgm_places.datasets import MapSimulation, generate_building, simulate_map

NAMES = ("corridor", "room", "doorway", "hall")
SEED, STYLE = 41, "clinic"
_MOST = 4.0
"""Deviation of log-odds that is drawn darkest."""


def floor() -> None:
    """A floor as a robot maps it, labels without and with networks, and where views differ."""
    drawn = generate_building(
        SEED,
        style=STYLE,
        halls="hall",
        furniture=False,
        slam_noise=False,  # type: ignore[arg-type]
    )
    plan = LabelledMap(drawn.grid, drawn.labels, name="plan")
    robot = MapSimulation(coverage=(0.75, 0.75), glass=(0.4, 0.4), corridor_furniture=(2.0, 2.0))
    grid = simulate_map(plan, NAMES, seed=SEED, options=robot, resolution_m=0.05).grid
    labeler = shipped()
    doubt = np.full(grid.shape, np.nan)
    doubt[grid.free] = labeler.unary_model_.seen(grid).doubt(np.argwhere(grid.free))
    picture = figure(8.4, 6.9)
    axes = picture.subplots(2, 2)
    draw_ground(axes[0, 0], grid)
    crop(axes[0, 0], grid)
    plain(axes[0, 0], "the map")
    for axis, method, title in (
        (axes[0, 1], "adaboost", "boosted lists alone"),
        (axes[1, 0], labeler.default_method, "with the networks"),
    ):
        draw_labels(axis, grid, label_map(labeler, grid, method=method).labels, title)
    draw_ground(axes[1, 1], grid)
    axes[1, 1].imshow(doubt, cmap=DOUBT, vmin=0, vmax=_MOST, **at(grid))
    crop(axes[1, 1], grid)
    plain(axes[1, 1], "where their views disagree")
    keep("floor", picture)
