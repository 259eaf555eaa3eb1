"""How pictures are kept: as small palette PNG files in docs/images, with the same look."""

import io
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.distance import cdist

from pgm_places import PlaceLabeler, label_map, trained_labeler
from pgm_places.datasets import generate_building
from pgm_places.datasets.building import LabelledBuilding
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import UNKNOWN, WALL, label_colours
from pgm_places.pictures.drawing import INK

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
NAMES = ("corridor", "room", "doorway")
COLOURS = label_colours(NAMES)
DPI = 150

_FREQUENT, _RARE = 150, 100


def keep(name: str, picture: bytes | Figure | Image.Image) -> None:
    """Write docs/images/NAME.png with a palette."""
    if isinstance(picture, Figure):
        buffer = io.BytesIO()
        picture.savefig(
            buffer, dpi=DPI, metadata={"Software": None}, bbox_inches="tight", pad_inches=0.08
        )
        picture = buffer.getvalue()
    image = Image.open(io.BytesIO(picture)) if isinstance(picture, bytes) else picture
    path = IMAGES / f"{name}.png"
    _reduced(image).save(path, optimize=True)
    print(f"wrote {path} ({image.width} x {image.height}, {path.stat().st_size / 1000:.0f} kB)")


def _reduced(image: Image.Image) -> Image.Image:
    """The picture in 250 colours: the most frequent ones as they are, the others in groups."""
    if image.mode == "RGBA":
        return image.quantize(_FREQUENT + _RARE, method=Image.Quantize.FASTOCTREE)
    pixels = np.asarray(image.convert("RGB"))
    colours, index, counts = np.unique(
        pixels.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(-counts)
    palette, others = colours[order[:_FREQUENT]], colours[order[_FREQUENT:]]
    if len(others):
        rare = Image.fromarray(others[None]).quantize(_RARE, Image.Quantize.MEDIANCUT)
        palette = np.concatenate([palette, np.reshape(rare.getpalette(), (-1, 3))[:_RARE]])
    nearest = cdist(colours, palette).argmin(axis=1)
    made = Image.fromarray(nearest[index].reshape(pixels.shape[:2]).astype(np.uint8), "P")
    made.putpalette(palette.astype(np.uint8).tobytes())
    return made


def figure(width: float, height: float, **layout: Any) -> Figure:
    """An empty figure without pyplot; inches of 150 pixels."""
    made = Figure(figsize=(width, height), layout="constrained", facecolor="white", **layout)
    FigureCanvasAgg(made)
    return made


def plain(axis: Axes, title: str = "") -> None:
    """No frame; a title at the left."""
    axis.set_axis_off()
    if title:
        axis.set_title(title, loc="left", fontsize=10.5, color=INK)


def span(grid: OccupancyGrid, margin: int = 6) -> tuple[slice, slice]:
    """Rows and columns of the known part."""
    rows, columns = np.nonzero(~grid.unknown)
    return (
        slice(max(0, rows.min() - margin), rows.max() + 1 + margin),
        slice(max(0, columns.min() - margin), columns.max() + 1 + margin),
    )


def draw_ground(axis: Axes, grid: OccupancyGrid) -> None:
    """Walls, unknown and free cells, in metres of the map frame."""
    kinds = np.where(grid.unknown, 0, np.where(grid.free, 1, 2))
    axis.imshow(kinds, cmap=ListedColormap([UNKNOWN, "white", WALL]), vmin=0, vmax=2, **at(grid))


def draw_labels(
    axis: Axes, grid: OccupancyGrid, labels: NDArray[Any], title: str = "", **style: Any
) -> None:
    """A map in the colours of its labels, cropped to what is known."""
    draw_ground(axis, grid)
    shown = np.ma.masked_where((labels < 0) | ~grid.free, labels)
    axis.imshow(shown, cmap=ListedColormap(COLOURS), vmin=0, vmax=2, **at(grid), **style)
    crop(axis, grid)
    plain(axis, title)


def at(grid: OccupancyGrid) -> dict[str, Any]:
    """What imshow needs to put cells where they are."""
    height, width = np.array(grid.shape) * grid.resolution_m
    x, y = grid.origin_xy_m
    extent = (x, x + width, y, y + height)
    return {"origin": "lower", "extent": extent, "interpolation": "nearest"}


def crop(axis: Axes, grid: OccupancyGrid) -> None:
    """The limits of the known part."""
    rows, columns = span(grid)
    (x, y), side = grid.origin_xy_m, grid.resolution_m
    axis.set_xlim(x + columns.start * side, x + columns.stop * side)
    axis.set_ylim(y + rows.start * side, y + rows.stop * side)


def legend(made: Figure, names: tuple[str, ...] = NAMES, colours: Any = COLOURS) -> None:
    """The labels below the pictures."""
    from matplotlib.patches import Patch

    handles = [Patch(color=colour, label=name) for name, colour in zip(names, colours, strict=True)]
    made.legend(
        handles=handles,
        loc="outside lower left",
        ncols=len(names),
        frameon=False,
        fontsize=10,
        handlelength=1.2,
        handleheight=1.0,
    )


@cache
def floor(seed: int, style: Any = "office", resolution_m: float = 0.05) -> LabelledBuilding:
    """A generated floor; the shipped models have learned from others."""
    return generate_building(seed, style=style, resolution_m=resolution_m)


@cache
def shipped() -> PlaceLabeler:
    """The model that ships with the package."""
    return trained_labeler()


@cache
def found_on(seed: int, style: Any = "office", method: str | None = None) -> LabelledPlaces:
    """A floor labelled by the shipped model."""
    return label_map(shipped(), floor(seed, style).grid, method=method)


def right(building: LabelledBuilding, labels: NDArray[Any]) -> float:
    """The share of the cells with a true label whose label is right."""
    compared = (building.labels >= 0) & (labels >= 0)
    return float(np.mean(building.labels[compared] == labels[compared]))
