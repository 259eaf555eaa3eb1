"""Pictures of training data: kinds of generated buildings, and robot-like maps of a plan."""

from collections.abc import Sequence

from experiments.pictures.kept import keep
from pgm_places.datasets import STYLES, MapSimulation, generate_building, simulate_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.palette import GROUND_SWATCHES, label_swatches
from pgm_places.pictures.canvas import label_canvas, view_of
from pgm_places.pictures.figure_grid import Panel, figure_grid

NAMES = ("corridor", "room", "doorway", "hall")
SEEDS = {
    "apartment": 4,
    "atrium": 7,
    "cells": 7,
    "clinic": 6,
    "hall": 1,
    "home": 4,
    "hotel": 4,
    "lab": 5,
    "mall": 2,
    "museum": 4,
    "open-plan": 3,
    "passage": 3,
    "ring": 8,
    "school": 9,
    "suite": 3,
    "university": 2,
}
RESOLUTION_M = 0.1
ROBOT = MapSimulation(
    entered_rooms=(0.4, 1.0),
    windows=(0.4, 0.5),
    closed_doors=(0.0, 0.4),
    large_furniture=(0.5, 1.2),
    slip_m=(0.0, 0.3),
    least_seen=0.45,
)
ROBOTS = {"apartment": (4, 1), "lab": (6, 3), "passage": (2, 2), "atrium": (7, 3)}
"""Seeds of the building and of the map, for each style."""


def panel(item: LabelledMap, title: str) -> Panel:
    """A map in the colours of its labels."""
    view = view_of(item.grid, most_pixels=400_000)
    return Panel(label_canvas(item.grid, item.labels, NAMES, view), title)


def _sheet(name: str, panels: Sequence[Panel], columns: int) -> None:
    """A sheet of maps with one legend."""
    legend = (*label_swatches(NAMES), *GROUND_SWATCHES)
    keep(name, figure_grid(panels, columns=columns, legend=legend, long_side=1000 * columns).png())


def kinds_of_buildings() -> None:
    """A building of each kind."""
    kinds = []
    for style in sorted(STYLES):
        if style in SEEDS:
            made = generate_building(
                SEEDS[style], style=style, resolution_m=RESOLUTION_M, halls="hall"
            )
            kinds.append(panel(LabelledMap(made.grid, made.labels), style))
    _sheet("kinds_of_buildings", kinds, columns=4)


def simulated_maps() -> None:
    """A plan, and three maps that a robot would make of it."""
    drawn = generate_building(
        9,
        style="school",
        resolution_m=RESOLUTION_M,
        halls="hall",
        furniture=False,
        slam_noise=False,
    )
    plan = LabelledMap(drawn.grid, drawn.labels, name="plan")
    robots = {seed: simulate_map(plan, NAMES, seed=seed) for seed in (0, 1, 4)}
    maps = [panel(made, f"simulated, seed {seed}") for seed, made in robots.items()]
    _sheet("simulated_maps", [panel(plan, "plan"), *maps], columns=2)


def robot_effects() -> None:
    """Plans, and maps of them with what robots' maps show."""
    panels = []
    for style, (seed, robot) in ROBOTS.items():
        drawn = generate_building(
            seed,
            style=style,  # type: ignore[arg-type]
            resolution_m=0.05,
            halls="hall",
            furniture=False,
            slam_noise=False,
        )
        plan = LabelledMap(drawn.grid, drawn.labels, name=style)
        made = simulate_map(plan, NAMES, seed=robot, options=ROBOT)
        panels += [panel(plan, style), panel(made, "as a robot maps it")]
    _sheet("robot_effects", panels, columns=4)
