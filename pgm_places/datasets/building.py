"""The bundled building: an office floor as a robot would map it, with exact labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen
from pgm_places.datasets.dice import Dice
from pgm_places.datasets.floor_plan import FloorPlan, Rect, Scale
from pgm_places.datasets.furniture import furnish, hang_doors
from pgm_places.datasets.style import OFFICE, Style, draw_style
from pgm_places.datasets.survey import survey
from pgm_places.datasets.wings import Wing, draw_wing, partition
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, UNKNOWN, OccupancyGrid

__all__ = ["LABEL_NAMES", "LabelledBuilding", "generate_building"]

LABEL_NAMES = ("corridor", "room", "doorway")
"""The labels of the generated building, in index order."""

_CORRIDOR, _ROOM, _DOORWAY = range(3)

_DOORWAY_MARGIN_CM = 30
"""A doorway reaches so far before and behind its wall: what hand-made labels of real maps show."""

_MARGIN_CM = 150
"""Unknown space that is left around a building."""

_STYLES = ("office", "varied")

_FINEST_M, _COARSEST_M = 0.02, 0.2


@dataclass(frozen=True, eq=False)
class LabelledBuilding:
    """A map with its ground truth.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    labels : (H, W) int16
        Label index per cell in the grid's order, -1 where the cell has no label: walls, furniture,
        what was never seen, and stray cells outside or cut off from the rest.
    label_names : tuple of str
        Name of each label index.
    split_column : int
        The column where the right half begins; both halves hold every label.
    name : str
        What to call the building.
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    label_names: tuple[str, ...]
    split_column: int
    name: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", frozen(self.labels))


@dataclass(frozen=True)
class _Size:
    """Lengths in centimetres that tell a whole floor from a small one."""

    wing_cm: tuple[int, int]
    height_cm: int
    kinds: tuple[str, ...]


_SIZES = {
    "floor": _Size((2600, 3100), 2400, ("tee", "bend", "spine", "loop")),
    "small": _Size((720, 860), 820, ("spine",)),
}


def generate_building(
    seed: int = 0,
    *,
    resolution_m: float | None = None,
    wings: int = 2,
    size: Literal["floor", "small"] = "floor",
    style: Literal["office", "varied"] = "office",
    furniture: bool = True,
    slam_noise: bool = True,
) -> LabelledBuilding:
    """A building drawn from a seed: the same cells on every platform, another building per seed.

    Wings stand side by side. Each has corridors that run straight, branch, turn or close a loop;
    rooms from small offices to seminar rooms; doors with leaves more or less open. A simulated
    tour with a laser then decides what is free, occupied or unknown.

    Parameters
    ----------
    seed : int
        Which building; not negative.
    resolution_m : float or None
        Side of a cell, 0.02 to 0.2 m in whole millimetres; 0.05, or 0.1 for a small building.
    wings : int
        How many wings; at least one.
    size : str
        ``"floor"`` (wings of about 28 x 24 m) or ``"small"`` (8 x 8 m: for quick tests).
    style : str
        ``"office"``, or ``"varied"``: corridors of 1.2 to 3.8 m, rooms from cells to halls, doors
        of 0.7 to 1.8 m, drawn for each building; for floors only.
    furniture : bool
        Whether anybody has moved in.
    slam_noise : bool
        Whether poses and ranges err, panes let rays through, and the map is slightly bent.

    Raises
    ------
    InputError
        An argument outside its range.

    Examples
    --------
    >>> building = generate_building(3, size="small")
    >>> building.label_names
    ('corridor', 'room', 'doorway')
    >>> building.grid.shape == building.labels.shape
    True
    """
    _check(seed, wings, size, style)
    scale = Scale(_millimetres(resolution_m, size))
    looks = OFFICE if style == "office" else draw_style(Dice(seed, 5))
    shape, plan, split = _draw_plan(Dice(seed, 0), scale, looks, _SIZES[size], wings)
    labels = _truth(scale, plan, shape)
    solid = _walls(plan, shape)
    glass = ~_open(plan.windows, shape) & solid
    hang_doors(Dice(seed, 1), scale, plan, solid)
    if furniture:
        furnish(Dice(seed, 2), scale, plan, solid)
    cells = survey(Dice(seed, 3), scale, plan, solid, glass, noise=slam_noise)
    if slam_noise:
        cells, labels = _bent(Dice(seed, 4), cells, labels)
    kept = _mapped_rows(cells, scale.cells(_MARGIN_CM))
    cells, labels = cells[kept], labels[kept]
    labels[~_main_component(cells == FREE)] = -1
    grid = OccupancyGrid(cells, scale.mm_per_cell / 1000)
    return LabelledBuilding(grid, labels, LABEL_NAMES, split, f"generated building {seed}")


def _check(seed: int, wings: int, size: str, style: str) -> None:
    if seed < 0:
        raise InputError(f"seed must not be negative, got {seed}")
    if wings < 1:
        raise InputError(f"wings must be at least 1, got {wings}")
    if size not in _SIZES:
        raise InputError(f"size must be one of {', '.join(_SIZES)}, got {size!r}")
    if style not in _STYLES:
        raise InputError(f"style must be one of {', '.join(_STYLES)}, got {style!r}")
    if style == "varied" and size != "floor":
        raise InputError(f"style 'varied' needs size 'floor', got size {size!r}")


def _millimetres(resolution_m: float | None, size: str) -> int:
    if resolution_m is None:
        return 100 if size == "small" else 50
    if not _FINEST_M <= resolution_m <= _COARSEST_M:
        raise InputError(
            f"resolution_m must be {_FINEST_M:g} to {_COARSEST_M:g} m, got {resolution_m}"
        )
    return round(1000 * resolution_m)


def _draw_plan(
    dice: Dice, scale: Scale, style: Style, size: _Size, wings: int
) -> tuple[tuple[int, int], FloorPlan, int]:
    """Shape of the raster, the plan in its cells, and the split column."""
    margin, height = scale.cells(_MARGIN_CM), scale.cells(style.height_cm or size.height_cm)
    y = height // 2 - scale.cells(110)
    x, plan, edges = 0, FloorPlan(), []
    for index, kind in enumerate(_kinds(dice, size.kinds, wings)):
        edges.append(x)
        length, width = (
            scale.cells(dice.integer(*size.wing_cm)),
            scale.cells(dice.integer(*style.corridor_cm)),
        )
        wing = Wing(x, x + length, height, min(y, height - width), width, scale.cells(20))
        drawn, y = draw_wing(dice, scale, style, wing, kind)
        plan.add(drawn)
        if index and dice.chance(2, 3):
            plan.add(partition(dice, scale, wing))
        x += length
    split = edges[wings // 2] if wings > 1 else x // 2
    return (height + 2 * margin, x + 2 * margin), plan.moved(margin, margin), split + margin


def _kinds(dice: Dice, kinds: tuple[str, ...], wings: int) -> list[str]:
    """A kind per wing, none twice before all have been used."""
    drawn: list[str] = []
    left: list[str] = []
    while len(drawn) < wings:
        left = left or list(kinds)
        drawn.append(left.pop(dice.integer(0, len(left) - 1)))
    return drawn


def _open(parts: Sequence[Rect], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """(H, W) True except where the rectangles are."""
    solid = np.ones(shape, bool)
    for part in parts:
        solid[part.slices] = False
    return solid


def _walls(plan: FloorPlan, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """(H, W) what is solid in the empty building."""
    solid = _open(plan.corridors + plan.rooms, shape)
    for wall in plan.walls:
        solid[wall.slices] = True
    for door in plan.doors:
        solid[door.gap.slices] = False
    return solid


def _truth(scale: Scale, plan: FloorPlan, shape: tuple[int, int]) -> NDArray[np.int16]:
    """(H, W) label of each cell of the empty building, -1 in walls."""
    labels = np.full(shape, -1, np.int16)
    for label, parts in ((_ROOM, plan.rooms), (_CORRIDOR, plan.corridors)):
        for part in parts:
            labels[part.slices] = label
    for door in plan.doors:
        labels[door.region(scale.cells(_DOORWAY_MARGIN_CM)).slices] = _DOORWAY
    return labels


def _bent(
    dice: Dice, cells: NDArray[np.int8], labels: NDArray[np.int16]
) -> tuple[NDArray[np.int8], NDArray[np.int16]]:
    """Both rasters with columns and rows pushed a little, as a mapper's drift does."""
    height, width = cells.shape
    rows, columns = np.indices((height, width), sparse=True)
    rows = np.clip(rows + _drift(dice, width)[None, :], 0, height - 1)
    columns = np.clip(columns + _drift(dice, height)[:, None], 0, width - 1)
    return cells[rows, columns], labels[rows, columns]


def _drift(dice: Dice, length: int) -> NDArray[np.int64]:
    """(length,) a slow wander around zero, in whole cells: up to 1 % of the length."""
    most = length // 200
    slope, wave = dice.integer(-most, most), dice.integer(-most, most)
    at = np.arange(length, dtype=np.int64) - length // 2
    return (slope * at // length) + (4 * wave * at * at // (length * length))


def _mapped_rows(cells: NDArray[np.int8], margin: int) -> slice:
    """The rows with anything known, and a margin."""
    known = np.flatnonzero((cells != UNKNOWN).any(axis=1))
    return slice(max(0, known[0] - margin), known[-1] + 1 + margin)


def _main_component(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the largest piece of free space whose cells touch by their sides."""
    from scipy import ndimage

    pieces, n_pieces = ndimage.label(free)
    sizes = np.bincount(pieces.ravel(), minlength=n_pieces + 1)
    sizes[0] = 0
    return np.asarray(pieces == sizes.argmax())
