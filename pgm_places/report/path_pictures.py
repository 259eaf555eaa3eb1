"""A robot's path over a map, in the colours of the places along it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import (
    GROUND_SWATCHES,
    IGNORED,
    IGNORED_STRIPE,
    Swatch,
    label_colours,
    label_swatches,
)
from pgm_places.report.canvas import Canvas, label_canvas, view_of
from pgm_places.report.figure import INK, MUTED
from pgm_places.report.sheet import Panel, sheet_png

__all__ = ["path_map"]

_MOST_PIXELS = 1_500_000
_POINTS_PER_PIXEL = 0.72
_PATH, _CASING, _OTHER = 5.0, 8.0, 2.0
"""Widths in pixels of the path, of the white line below it, and of a path to compare with."""

_NO_LABEL = "#8d96a3"
_OTHER_COLOUR = "#0f766e"
"""Neither a place's nor a wall's; the line is thin and dashed besides."""


def path_map(
    grid: OccupancyGrid,
    positions_m: ArrayLike,
    labels: ArrayLike,
    label_names: Sequence[str],
    *,
    other_m: ArrayLike | None = None,
    other_name: str = "odometry",
    title: str | None = None,
) -> bytes:
    """A PNG file of a path over a map, right way up and cropped to what is known.

    Parameters
    ----------
    grid : OccupancyGrid
        The map, in the frame of the positions.
    positions_m : (T, 2) float
        The robot's positions, step by step.
    labels : (T,) int
        The place at each step, -1 for none; it colours the path up to the next step.
    label_names : sequence of str
        Names of the labels; they choose the colours too.
    other_m : (S, 2) float, optional
        A thin line to compare with, such as what the odometry tells.
    other_name : str
        What that line is.
    title : str or None

    Raises
    ------
    InputError
        Positions and labels differ in number, or a label has no name.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0], [100, -1, 0]], resolution_m=0.5)
    >>> path_map(grid, [[0.2, 0.2], [1.2, 0.2]], [0, 1], ["corridor", "room"])[1:4]
    b'PNG'
    """
    positions = finite_array("positions_m", positions_m, ("T", 2))
    places = integer_array("labels", labels, (len(positions),), low=-1, high=len(label_names))
    other = None if other_m is None else finite_array("other_m", other_m, ("S", 2))
    view = view_of(grid, most_pixels=_MOST_PIXELS)
    nowhere = np.full(grid.shape, -1, np.int16)
    canvas = _without_stripes(label_canvas(grid, nowhere, label_names, view))
    colours = [*label_colours(label_names), _NO_LABEL]  # -1 counts from the end

    def draw(axes: Any) -> None:
        pixels = view.pixels_at_m(grid, positions)
        if other is not None:
            _line(axes, view.pixels_at_m(grid, other), _OTHER_COLOUR, _OTHER, dashes=(4, 2))
        _line(axes, pixels, "white", _CASING)
        _pieces(axes, pixels, [colours[place] for place in places])
        _ends(axes, pixels)

    entries = [*label_swatches(label_names)]
    if (places < 0).any():
        entries.append(Swatch("no label", _NO_LABEL))
    if other is not None:
        entries.append(Swatch(f"{other_name} (dashed)", _OTHER_COLOUR))
    entries += [item for item in GROUND_SWATCHES if not item.hatched]
    return sheet_png([Panel(canvas, overlay=draw)], title=title, legend=entries)


def _without_stripes(canvas: Canvas) -> Canvas:
    """Free space in plain white: on this picture no cell is expected to have a label."""
    colours = tuple(IGNORED if colour == IGNORED_STRIPE else colour for colour in canvas.colours)
    return replace(canvas, colours=colours)


def _line(
    axes: Any,
    points: NDArray[np.float64],
    colour: str,
    width: float,
    dashes: tuple[float, float] | None = None,
) -> None:
    axes.plot(
        points[:, 0],
        points[:, 1],
        color=colour,
        linewidth=width * _POINTS_PER_PIXEL,
        linestyle=(0, dashes) if dashes else "-",
        solid_capstyle="round",
        solid_joinstyle="round",
    )


def _pieces(axes: Any, points: NDArray[np.float64], colours: Sequence[str]) -> None:
    """One line per run of steps with the same colour, up to where the next run begins."""
    first = 0
    for step in range(1, len(points) + 1):
        if step == len(points) or colours[step] != colours[first]:
            _line(axes, points[first : step + 1], colours[first], _PATH)
            first = step


def _ends(axes: Any, points: NDArray[np.float64]) -> None:
    """A ring where the path begins, a disc where it ends."""
    if not len(points):
        return
    for point, face, name in ((points[0], "white", "start"), (points[-1], INK, "end")):
        axes.plot(*point, marker="o", markersize=7, markerfacecolor=face, markeredgecolor=INK)
        axes.annotate(
            name,
            point,
            xytext=(7, 6),
            textcoords="offset points",
            fontsize=12,
            color=INK,
            bbox={"facecolor": "white", "edgecolor": MUTED, "linewidth": 0.4, "pad": 1.5},
        )
