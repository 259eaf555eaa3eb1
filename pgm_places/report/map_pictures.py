"""Pictures of labelled maps: labels, differences, probabilities, and an overview."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.palette import (
    ERROR,
    IGNORED,
    RIGHT_TINT,
    UNKNOWN,
    WALL,
    label_colours,
    tinted,
)
from pgm_places.report.canvas import (
    View,
    checked_labels,
    difference_canvas,
    label_canvas,
    row_bands,
    value_canvas,
    view_of,
)
from pgm_places.report.sheet import ColourBar, Entry, Panel, sheet_png

__all__ = ["difference_map", "entropy", "label_map", "overview", "probability_maps"]

_NODES_AT_ONCE = 262_144
_MOST_PIXELS = 1_500_000
_GROUND_ENTRIES = (
    Entry(WALL, "occupied"),
    Entry(UNKNOWN, "unknown"),
    Entry(IGNORED, "free, no label", hatched=True),
)


def label_map(
    grid: OccupancyGrid,
    label_raster: ArrayLike,
    label_names: Sequence[str],
    *,
    title: str | None = None,
    scale_bar: bool = True,
    legend: bool = True,
) -> bytes:
    """A PNG file of a labelled map, right way up and cropped to what is known.

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
    labels = checked_labels(grid, label_raster, len(label_names), "label_raster")
    view = view_of(grid, most_pixels=_MOST_PIXELS)
    canvas = label_canvas(grid, labels, label_names, view)
    entries = (*_label_entries(label_names), *_GROUND_ENTRIES) if legend else ()
    return sheet_png([Panel(canvas)], title=title, legend=entries, scale_bar=scale_bar)


def difference_map(
    grid: OccupancyGrid,
    truth: ArrayLike,
    predicted: ArrayLike,
    label_names: Sequence[str],
    *,
    title: str | None = None,
) -> bytes:
    """A PNG file of where a prediction is wrong: errors in red over pale right answers.

    ``truth`` and ``predicted`` are (H, W) label indices; cells where either is -1 do not count.

    Raises
    ------
    InputError
        A raster of another shape, or a label without a name.
    """
    true = checked_labels(grid, truth, len(label_names), "truth")
    found = checked_labels(grid, predicted, len(label_names), "predicted")
    view = view_of(grid, most_pixels=_MOST_PIXELS)
    canvas = difference_canvas(grid, true, found, label_names, view)
    n_wrong = n_compared = 0
    for rows in row_bands(grid.shape):
        compared = (true[rows] >= 0) & (found[rows] >= 0) & (grid.cells[rows] == FREE)
        n_compared += int(compared.sum())
        n_wrong += int((compared & (true[rows] != found[rows])).sum())
    share = f" ({100 * n_wrong / n_compared:.1f} %)" if n_compared else ""
    entries = [Entry(ERROR, f"wrong: {n_wrong} of {n_compared} cells{share}")]
    entries += [
        Entry(tinted(colour, RIGHT_TINT), f"{name}, right")
        for name, colour in zip(label_names, label_colours(label_names), strict=True)
    ]
    return sheet_png([Panel(canvas)], title=title, legend=[*entries, *_GROUND_ENTRIES])


def probability_maps(
    grid: OccupancyGrid,
    beliefs: ArrayLike,
    layout: GridLayout,
    label_names: Sequence[str],
    *,
    title: str | None = None,
) -> bytes:
    """A PNG file with a map per label of its probability, and one of the entropy.

    Parameters
    ----------
    grid : OccupancyGrid
    beliefs : (N, K) float
        Probability of each label at each node.
    layout : GridLayout
        The nodes' cells.
    label_names : sequence of str
    title : str or None

    Raises
    ------
    InputError
        Beliefs that fit neither the layout nor the names.
    """
    array = finite_array("beliefs", beliefs, (len(layout.cells_rc), len(label_names)))
    view = view_of(grid, layout.node_of_cell >= 0, most_pixels=_MOST_PIXELS // 2)
    panels = [
        Panel(value_canvas(grid, array[:, k], layout, "probability", view), name)
        for k, name in enumerate(label_names)
    ]
    panels.append(_entropy_panel(grid, array, layout, view))
    bars = (
        ColourBar("probability", "probability"),
        ColourBar("entropy", "entropy", "0", "largest"),
    )
    return sheet_png(panels, columns=2, title=title, bars=bars)


def entropy(beliefs: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """(N,) entropy of each row of beliefs (N, K) as a share of the largest, ``log K``."""
    n_labels = beliefs.shape[1]
    if n_labels < 2:
        return np.zeros(len(beliefs))
    share = np.empty(len(beliefs))
    for first in range(0, len(beliefs), _NODES_AT_ONCE):
        part = slice(first, first + _NODES_AT_ONCE)
        positive = np.clip(beliefs[part], np.finfo(np.float64).tiny, 1.0)
        share[part] = -(positive * np.log(positive)).sum(axis=1) / np.log(n_labels)
    return np.clip(share, 0.0, 1.0, out=share)


def overview(
    grid: OccupancyGrid,
    label_raster: ArrayLike,
    label_names: Sequence[str],
    *,
    beliefs: ArrayLike | None = None,
    layout: GridLayout | None = None,
    title: str | None = None,
) -> bytes:
    """A PNG file to look at first: the labels with their areas and, with beliefs, the entropy.

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
    labels = checked_labels(grid, label_raster, len(label_names), "label_raster")
    view = view_of(grid, most_pixels=_MOST_PIXELS // (1 if beliefs is None else 2))
    panels = [Panel(label_canvas(grid, labels, label_names, view), "labels")]
    bars: tuple[ColourBar, ...] = ()
    if beliefs is not None:
        if layout is None:
            raise InputError("beliefs need the layout of their nodes; pass layout as well")
        shape = (len(layout.cells_rc), len(label_names))
        array = finite_array("beliefs", beliefs, shape, dtype=None)
        panels.append(_entropy_panel(grid, array, layout, view))
        bars = (ColourBar("entropy", "entropy", "sure", "undecided"),)
    height, width = view.shape
    return sheet_png(
        panels,
        columns=1 if width > 1.3 * height else 2,
        title=title,
        legend=(*_area_entries(grid, labels, label_names), *_GROUND_ENTRIES),
        bars=bars,
    )


def _entropy_panel(
    grid: OccupancyGrid, beliefs: NDArray[np.floating[Any]], layout: GridLayout, view: View
) -> Panel:
    return Panel(value_canvas(grid, entropy(beliefs), layout, "entropy", view), "entropy")


def _label_entries(label_names: Sequence[str]) -> list[Entry]:
    colours = label_colours(label_names)
    return [Entry(colour, name) for name, colour in zip(label_names, colours, strict=True)]


def _area_entries(
    grid: OccupancyGrid, labels: NDArray[np.integer], label_names: Sequence[str]
) -> list[Entry]:
    counts = np.zeros(len(label_names), np.int64)
    for rows in row_bands(grid.shape):
        band = labels[rows]
        counts += np.bincount(band[band >= 0], minlength=len(label_names))
    total = max(int(counts.sum()), 1)
    areas = counts * grid.resolution_m**2
    return [
        Entry(entry.colour, f"{entry.text}  {area:.1f} m², {100 * count / total:.0f} %")
        for entry, area, count in zip(_label_entries(label_names), areas, counts, strict=True)
    ]
