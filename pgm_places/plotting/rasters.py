"""Rasters of a map drawn in metres of the map frame: ground, labels, and values of cells."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places import palette
from pgm_places.plotting.axes import legend_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_PIXELS = 2000


class Frame(NamedTuple):
    """Where a raster lies: the side of its cells, its lower left corner, and its rotation."""

    resolution_m: float
    origin_xy_m: tuple[float, float]
    yaw_rad: float


def draw_ground(ax: "Axes", cells: NDArray[np.int8], frame: Frame) -> None:
    """Draw walls (100) dark, unknown cells (-1) grey and free ones (0) white, equal in x and y."""
    step = _step(cells.shape)
    colours = np.empty((3, 3), np.uint8)
    colours[:] = [palette.rgb_of(c) for c in (palette.UNKNOWN, "#ffffff", palette.WALL)]
    _draw(ax, colours[np.sign(cells[::step, ::step]) + 1], frame, step)
    known = cells >= 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if len(rows):  # the view covers the known cells
        sides = [(columns[0], rows[0]), (columns[-1] + 1, rows[-1] + 1)]
        low, high = (np.array(side) * frame.resolution_m for side in sides)
        corners = [low, (low[0], high[1]), (high[0], low[1]), high]
        ax.update_datalim(_turned(frame).transform(corners))
        ax.autoscale_view()
    ax.set(xlabel="x (m)", ylabel="y (m)")
    ax.set_aspect("equal")


def draw_labels(
    ax: "Axes", labels: NDArray[np.integer[Any]], names: Sequence[str], frame: Frame
) -> None:
    """Draw the labelled cells (H, W) in the colours of their labels, with a legend."""
    step = _step(labels.shape)
    shown = labels[::step, ::step]
    colours = np.zeros((len(names) + 1, 4), np.uint8)  # the last one, for -1, is transparent
    for number, colour in enumerate(palette.label_colours(names)):
        colours[number] = [*palette.rgb_of(colour), 255]
    _draw(ax, colours[shown], frame, step)
    present = np.unique(shown[shown >= 0])
    swatches = palette.label_swatches(names)
    legend_beside(ax, [_patch(swatches[number]) for number in present])


def draw_values(
    ax: "Axes", values: NDArray[np.floating[Any]], frame: Frame, *, gradient: str, title: str
) -> None:
    """Draw values from 0 to 1 of cells (H, W), nothing where they are NaN, with a colour bar."""
    from matplotlib.colors import ListedColormap

    step = _step(values.shape)
    colours = ListedColormap(palette.levels(gradient, 256))
    image = _draw(ax, values[::step, ::step], frame, step, cmap=colours, vmin=0, vmax=1)
    ax.figure.colorbar(image, ax=ax, label=title)


def _patch(swatch: palette.Swatch) -> Any:
    from matplotlib.patches import Patch

    return Patch(facecolor=swatch.colour, label=swatch.name)


def _step(shape: tuple[int, ...]) -> int:
    """The step at which cells are drawn: a figure has fewer pixels than a huge map."""
    return max(1, max(shape) // _MOST_PIXELS)


def _turned(frame: Frame) -> Any:
    from matplotlib.transforms import Affine2D

    return Affine2D().rotate(frame.yaw_rad).translate(*frame.origin_xy_m)


def _draw(ax: "Axes", image: NDArray[Any], frame: Frame, step: int, **options: Any) -> Any:
    """Draw an image of every ``step``-th cell; the limits of the axes stay."""
    side = step * frame.resolution_m
    limits = ax.dataLim.frozen()
    drawn = ax.imshow(
        image,
        origin="lower",
        extent=(0, image.shape[1] * side, 0, image.shape[0] * side),
        interpolation="none",
        transform=_turned(frame) + ax.transData,
        **options,
    )
    ax.dataLim.set(limits)
    ax.autoscale_view()
    return drawn
