"""The picture of the first page: a floor as the robot sees it turns into places."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from experiments.pictures.kept import IMAGES, keep
from pgm_places import label_map, load_map, topological_map, trained_labeler
from pgm_places.palette import GROUND_SWATCHES, label_colours, label_swatches, rgb_of
from pgm_places.pictures.canvas import label_canvas, view_of
from pgm_places.pictures.figure_grid import Panel, figure_grid
from pgm_places.simulation import generate_building

MARGIN = 6
"""Unknown cells around a map."""

CARD = (640, 280)
CROPS = {
    # name of the card: the picture, and the left, upper and right ends of its part
    "map": ("own_map", 110, 487, 1030),
    "drive": ("tracked_path", 45, 105, 1160),
    "growing": ("growing_map", 781, 79, 1131),
    "studio": ("studio", 110, 235, 930),
    "batch": ("many_maps", 30, 480, 640),
    "problem": ("own_problem", 0, 40, 1200),
}
THEMES = {
    # walls, free space before it is labelled, the line between before and after
    "light": ("#2d3540", "#e3e6ea", "#2d3540"),
    "dark": ("#cfd5de", "#39424e", "#f4f6f8"),
}


def hero() -> None:
    """One picture for light pages and one for dark ones, transparent where nothing is known."""
    grid = generate_building(66, style="clinic", resolution_m=0.05).grid
    places = label_map(trained_labeler(), grid)
    colours = label_colours(places.label_names)
    rows, columns = (_extent(~grid.unknown, axis) for axis in (1, 0))
    height, width = rows.stop - rows.start, columns.stop - columns.start
    y, x = np.mgrid[:height, :width]
    edge = 0.30 * width + 0.22 * y  # leans to the right as it goes up
    labelled = x > edge
    for theme, (wall, free, line) in THEMES.items():
        picture = np.zeros((height, width, 4), np.uint8)
        shades = np.array([rgb_of(colour) for colour in (*colours, free, wall)])
        index = np.where(labelled, places.labels[rows, columns], 3)
        index[index < 0] = 3
        index[grid.occupied[rows, columns]] = 4
        picture[..., :3] = shades[index]
        picture[..., 3] = 255 * ~grid.unknown[rows, columns]
        image = Image.fromarray(picture[::-1])
        image = image.resize((2 * width, 2 * height), Image.Resampling.NEAREST)
        top, bottom = (2 * (0.30 * width + 0.22 * at) for at in (height, 0))
        ImageDraw.Draw(image).line((top, 0, bottom, 2 * height), fill=line, width=5)
        size = (1600, round(1600 * height / width))
        keep(f"hero_{theme}", image.resize(size, Image.Resampling.LANCZOS))


def _extent(known: NDArray[np.bool_], axis: int) -> slice:
    """The rows (axis 1) or columns (axis 0) of the known part, with a margin."""
    [index] = np.nonzero(known.any(axis=axis))
    return slice(max(0, index[0] - MARGIN), index[-1] + 1 + MARGIN)


def cards() -> None:
    """Parts of other pictures for the cards below it."""
    for card, (name, left, upper, right) in CROPS.items():
        image = Image.open(IMAGES / f"{name}.png").convert("RGB")
        lower = upper + round((right - left) * CARD[1] / CARD[0])
        part = image.crop((left, upper, right, lower))
        keep(f"card_{card}", part.resize(CARD, Image.Resampling.LANCZOS))


def readme() -> None:
    """A robot's map beside its places, for the README; from the folder of real maps."""
    grid = load_map(Path(os.environ["PGM_PLACES_DATA"]) / "robots" / "lab_uma" / "map.yaml").grid
    found = label_map(trained_labeler(), grid)
    places = topological_map(grid, found.labels, found.label_names, doorways=found.doorways)
    view = view_of(grid, most_pixels=300_000)
    nothing = np.full(grid.shape, -1, np.int16)
    panels = [
        Panel(label_canvas(grid, nothing, found.label_names, view), "the robot's map"),
        Panel(label_canvas(grid, places.labels, found.label_names, view), "its places"),
    ]
    entries = (*label_swatches(found.label_names), *GROUND_SWATCHES)
    drawn = figure_grid(panels, columns=2, legend=entries, long_side=1400)
    keep("readme", drawn.image)
