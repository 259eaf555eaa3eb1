"""Pictures of maps: the labels, an overview with the uncertainty, and a robot's path."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _checks
from pgm_places._checks import finite_array, integer_array
from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import normalized_entropy
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import (
    GROUND_SWATCHES,
    IGNORED,
    IGNORED_STRIPE,
    Swatch,
    label_colours,
    label_swatches,
)
from pgm_places.pictures.canvas import Canvas, label_canvas, value_canvas, view_of
from pgm_places.pictures.drawing import INK, MUTED, Drawing, text_width
from pgm_places.pictures.figure_grid import ColourBar, Panel, figure_grid

_MOST_PIXELS = 1_500_000
_THUMBNAIL_PIXELS = 40_000


def label_map(
    grid: OccupancyGrid,
    label_raster: ArrayLike,
    label_names: Sequence[str],
    *,
    title: str | None = None,
    scale_bar: bool = True,
    legend: bool = True,
) -> bytes:
    """A PNG file of a labelled map, with y upwards, cropped to its known cells.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    label_raster : (H, W) int
        Label index per cell in the grid's order, -1 for none.
    label_names : sequence of str
        Names of the labels; they choose the colours too.
    title : str or None
    scale_bar, legend : bool

    Raises
    ------
    InputError
        A raster of another shape, or a label without a name.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0], [100, -1]], resolution_m=0.5)
    >>> label_map(grid, [[0, 1], [-1, -1]], ["corridor", "room"])[1:4]
    b'PNG'
    """
    labels = _checks.label_raster("label_raster", label_raster, grid.shape, len(label_names))
    view = view_of(grid, most_pixels=_MOST_PIXELS)
    canvas = label_canvas(grid, labels, label_names, view)
    entries = (*label_swatches(label_names), *GROUND_SWATCHES) if legend else ()
    return figure_grid([Panel(canvas)], title=title, legend=entries, scale_bar=scale_bar).png()


def path_cells(
    grid: OccupancyGrid,
    label_raster: NDArray[np.integer],
    label_names: Sequence[str],
    *,
    title: str | None = None,
) -> bytes:
    """A PNG file of the labels of the cells along a path, with a legend."""
    labels = _checks.label_raster("label_raster", label_raster, grid.shape, len(label_names))
    view = view_of(grid, most_pixels=_MOST_PIXELS)
    canvas = _unhatched(label_canvas(grid, labels, label_names, view))
    entries = (*label_swatches(label_names), *_PLAIN_SWATCHES)
    return figure_grid([Panel(canvas)], title=title, legend=entries).png()


_PLAIN_SWATCHES = tuple(item for item in GROUND_SWATCHES if not item.hatched)


def _unhatched(canvas: Canvas) -> Canvas:
    """Free space in plain white, as hardly a cell of the picture has a label."""
    plain = (IGNORED if colour == IGNORED_STRIPE else colour for colour in canvas.colours)
    return replace(canvas, colours=tuple(plain))


def thumbnail(
    grid: OccupancyGrid, label_raster: NDArray[np.integer], label_names: Sequence[str]
) -> bytes:
    """A thumbnail of a labelled map without legend: a PNG file of a few kilobytes."""
    labels = _checks.label_raster("label_raster", label_raster, grid.shape, len(label_names))
    view = view_of(grid, most_pixels=_THUMBNAIL_PIXELS)
    return label_canvas(grid, labels, label_names, view).png()


def overview(
    grid: OccupancyGrid,
    label_raster: ArrayLike,
    label_names: Sequence[str],
    *,
    beliefs: ArrayLike | None = None,
    layout: GridLayout | None = None,
    title: str | None = None,
) -> Drawing:
    """A picture of the labels and, with beliefs, of the uncertainty: their normalised entropy.

    Parameters
    ----------
    grid : OccupancyGrid
    label_raster : (H, W) int
        Label index per cell in the grid's order, -1 for none.
    label_names : sequence of str
    beliefs : (N, K) float or None
        Probabilities per node of ``layout``.
    layout : GridLayout or None
    title : str or None

    Raises
    ------
    InputError
        Shapes that do not fit, or beliefs without a layout.
    """
    labels = _checks.label_raster("label_raster", label_raster, grid.shape, len(label_names))
    view = view_of(grid, most_pixels=_MOST_PIXELS // (1 if beliefs is None else 2))
    panels = [Panel(label_canvas(grid, labels, label_names, view), "Labels")]
    bars: tuple[ColourBar, ...] = ()
    if beliefs is not None:
        if layout is None:
            raise InputError("beliefs need the layout of their nodes; pass layout as well")
        shape = (layout.n_nodes, len(label_names))
        array = _checks.finite_array("beliefs", beliefs, shape, dtype=None)
        canvas = value_canvas(
            grid, lambda some: normalized_entropy(array[some]), layout, "entropy", view
        )
        panels.append(Panel(canvas, "Uncertainty"))
        bars = (ColourBar("entropy", "uncertainty", "0 (certain)", "1 (undecided)"),)
    height, width = view.shape
    return figure_grid(
        panels,
        columns=1 if width > 1.3 * height else 2,
        title=title,
        legend=(*label_swatches(label_names), *GROUND_SWATCHES),
        bars=bars,
    )


_PATH, _CASING, _OTHER = 5.0, 8.0, 2.0
"""Widths in pixels of the path, of the white line below it, and of a path to compare with."""

_TEXT = 16
_NO_LABEL = "#8d96a3"
_OTHER_COLOUR = "#0f766e"
"""Different from the colours of labels and walls; the line is also thin and dashed."""


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
    """A PNG file of a path over a map, with y upwards, cropped to the known cells.

    Parameters
    ----------
    grid : OccupancyGrid
        The map, in the frame of the positions.
    positions_m : (T, 2) float
        The robot's positions, step by step.
    labels : (T,) int
        Label of each step, -1 for none; it colours the path up to the next step.
    label_names : sequence of str
        Names of the labels; they choose the colours too.
    other_m : (S, 2) float, optional
        Another path, drawn as a thin line for comparison, such as the odometry.
    other_name : str
        Name of that line.
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
    canvas = _unhatched(label_canvas(grid, nowhere, label_names, view))
    colours = [*label_colours(label_names), _NO_LABEL]  # -1 counts from the end

    def draw(panel: Drawing, scale: int) -> None:
        pixels = scale * view.pixels_at_m(grid, positions)
        if other is not None:
            dashed = scale * view.pixels_at_m(grid, other)
            panel.line(dashed, colour=_OTHER_COLOUR, width=_OTHER, dashes=(8, 4))
        panel.line(pixels, colour="white", width=_CASING)
        _pieces(panel, pixels, [colours[place] for place in places])
        _ends(panel, pixels)

    entries = [*label_swatches(label_names)]
    if (places < 0).any():
        entries.append(Swatch("no label", _NO_LABEL))
    if other is not None:
        entries.append(Swatch(f"{other_name} (dashed)", _OTHER_COLOUR))
    entries += _PLAIN_SWATCHES
    return figure_grid([Panel(canvas, overlay=draw)], title=title, legend=entries).png()


def _pieces(panel: Drawing, points: NDArray[np.float64], colours: Sequence[str]) -> None:
    """One line per run of steps with the same colour, up to where the next run begins."""
    first = 0
    for step in range(1, len(points) + 1):
        if step == len(points) or colours[step] != colours[first]:
            panel.line(points[first : step + 1], colour=colours[first], width=_PATH)
            first = step


def _ends(panel: Drawing, points: NDArray[np.float64]) -> None:
    """A ring where the path begins, a disc where it ends."""
    if not len(points):
        return
    for (x, y), face, name in ((points[0], "white", "start"), (points[-1], INK, "end")):
        panel.disc((x, y), diameter=10, fill=face, edge=INK)
        width = text_width(name, _TEXT) + 8
        panel.box(x + 9, y - 20, width, 22, fill="white", edge=MUTED)
        panel.text(x + 13, y - 9, name, size=_TEXT)
