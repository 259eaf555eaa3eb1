"""The pictures of docs/training_data.md: ``python -m experiments.training_pictures``."""

from collections.abc import Sequence
from pathlib import Path

from pgm_places.datasets import STYLES, generate_building, simulate_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.palette import GROUND_SWATCHES, label_swatches
from pgm_places.report.canvas import label_canvas, view_of
from pgm_places.report.sheet import Panel, sheet_png

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
NAMES = ("corridor", "room", "doorway", "hall")
SEEDS = {
    "cells": 7,
    "clinic": 6,
    "hall": 1,
    "home": 4,
    "hotel": 4,
    "mall": 2,
    "museum": 4,
    "open-plan": 3,
    "ring": 8,
    "school": 9,
    "suite": 3,
    "university": 2,
}
RESOLUTION_M = 0.1


def panel(item: LabelledMap, title: str) -> Panel:
    """A map in the colours of its labels."""
    view = view_of(item.grid, most_pixels=400_000)
    return Panel(label_canvas(item.grid, item.labels, NAMES, view), title)


def write(path: Path, panels: Sequence[Panel], columns: int) -> None:
    """A sheet of maps with one legend."""
    legend = (*label_swatches(NAMES), *GROUND_SWATCHES)
    path.write_bytes(sheet_png(panels, columns=columns, legend=legend, long_side=1000 * columns))
    print(f"wrote {path}")


def main() -> None:
    """Draw both sheets."""
    kinds = []
    for style in STYLES:
        if style in SEEDS:
            made = generate_building(
                SEEDS[style], style=style, resolution_m=RESOLUTION_M, halls="hall"
            )
            kinds.append(panel(LabelledMap(made.grid, made.labels), style))
    write(IMAGES / "kinds_of_buildings.png", kinds, columns=4)
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
    write(IMAGES / "simulated_maps.png", [panel(plan, "plan"), *maps], columns=2)


if __name__ == "__main__":
    main()
