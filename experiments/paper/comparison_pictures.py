"""Pictures of a comparison as in the paper: the labels of each method, and its errors."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.paper.confusion_picture import confusion_picture
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.evaluated_items import TestItem
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.palette import ERROR, GROUND_SWATCHES, RIGHT_TINT, Swatch, label_swatches, tinted
from pgm_places.pictures.canvas import View, difference_canvas, label_canvas, view_of
from pgm_places.pictures.figure_grid import Panel, figure_grid

MARGIN_M = 0.5
"""How much of the map around the tested part is shown."""

_MOST_PIXELS = 400_000
_PANEL_SIDE = 900


def label_sheet(comparison: Comparison, index: int = 0, *, title: str | None = None) -> bytes:
    """A PNG file: the ground truth and each method's labels of a test map, side by side."""
    item, names = comparison.maps[index], comparison.label_names
    grid, view = _shown(item)
    truth = item.layout.to_raster(item.node_truth, fill=-1)
    panels = [Panel(label_canvas(grid, truth, names, view), "ground truth")]
    for method in comparison.methods:
        canvas = label_canvas(grid, _raster(item, method, index), names, view)
        panels.append(Panel(canvas, f"{method.id}: {_correct(method, index)}"))
    return _sheet(panels, view, title, label_swatches(names))


def error_sheet(comparison: Comparison, index: int = 0, *, title: str | None = None) -> bytes:
    """A PNG file: the errors of each method on a test map, over pale correct labels."""
    item, names = comparison.maps[index], comparison.label_names
    grid, view = _shown(item)
    panels = []
    for method in comparison.methods:
        raster = _raster(item, method, index)
        canvas = difference_canvas(grid, item.truth, raster, names, view)
        evaluation = method.evaluations[index]
        wrong = evaluation.n - int(np.trace(evaluation.confusion))
        panels.append(
            Panel(canvas, f"{method.id}: errors in {wrong:,} of {evaluation.n:,} {item.unit}s")
        )
    entries = [Swatch("error", ERROR)]
    entries += [
        Swatch(f"{item.name}, correct", tinted(item.colour, RIGHT_TINT))
        for item in label_swatches(names)
    ]
    return _sheet(panels, view, title, entries)


def confusion_of(method: MethodResult) -> bytes:
    """A PNG file with the confusion matrix of a method over all test maps."""
    evaluation = method.evaluation
    return confusion_picture(evaluation.confusion, evaluation.label_names, title=method.id)


def window_grid(grid: OccupancyGrid, window: NDArray[np.bool_]) -> OccupancyGrid:
    """The map with everything but the window's rectangle and a margin unknown.

    Pictures are cropped to what is known, so they show that part only.
    """
    used = window & (grid.cells != UNKNOWN)
    if not used.any():
        return grid
    margin = round(MARGIN_M / grid.resolution_m)
    outside = np.ones(grid.shape, np.bool_)
    spans = []
    for axis in (1, 0):
        at = np.flatnonzero(used.any(axis=axis))
        spans.append(slice(max(int(at[0]) - margin, 0), int(at[-1]) + 1 + margin))
    outside[spans[0], spans[1]] = False
    cells = np.where(outside, UNKNOWN, grid.cells).astype(np.int8)
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xy_m, grid.yaw_rad)


def _shown(item: TestItem) -> tuple[OccupancyGrid, View]:
    grid = window_grid(item.grid, item.window)
    return grid, view_of(grid, most_pixels=_MOST_PIXELS)


def _raster(item: TestItem, method: MethodResult, index: int) -> NDArray[np.int16]:
    labels = method.labelings[index].labels.astype(np.int16)
    raster: NDArray[np.int16] = item.layout.to_raster(labels, fill=-1)
    return raster


def _correct(method: MethodResult, index: int) -> str:
    return f"{100 * method.evaluations[index].accuracy:.1f} % correct"


def _sheet(
    panels: Sequence[Panel], view: View, title: str | None, legend: Sequence[Swatch]
) -> bytes:
    height, width = view.shape
    most = 3 if len(panels) == 3 else 2  # no gap at the end of a second row
    columns = 1 if width > 2.5 * height else min(most, len(panels))
    return figure_grid(
        panels,
        columns=columns,
        title=title,
        legend=(*legend, *GROUND_SWATCHES),
        long_side=_PANEL_SIDE * columns,
    ).png()
