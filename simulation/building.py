"""Generated buildings: floors as mapped by a simulated robot, with exact labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places._checks import require_at_least, set_frozen
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import FREE, OccupancyGrid
from pgm_places.simulation.distortion import shifted
from pgm_places.simulation.floor_plan import FloorPlan, Rect
from pgm_places.simulation.furniture import furnish, furnish_largely, hang_doors
from pgm_places.simulation.layout import Wing, draw_layout, draw_wing, partition
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.room_placement import draw_floor
from pgm_places.simulation.simulated_mapping import main_component, mapped_span, survey
from pgm_places.simulation.style import KINDS, OFFICE, Style, StyleName, draw_style, style_of_kind
from pgm_places.unary.options import HallsAs

LABEL_NAMES = ("corridor", "room", "doorway")
"""The labels of the generated building, in index order."""

_CORRIDOR, _ROOM, _DOORWAY, _HALL = range(4)

_MARGIN_CM = 150
"""Width of the unknown space around a building."""

STYLES: tuple[str, ...] = get_args(StyleName)
"""The styles of generated buildings."""

_FINEST_M, _COARSEST_M = 0.02, 0.2


@public
@dataclass(frozen=True, eq=False)
class LabelledBuilding:
    """A map with its ground truth.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    labels : (H, W) int16
        Label index per cell in the grid's order, -1 where the cell has no label: walls, furniture,
        unknown cells, and cells outside or disconnected from the rest.
    label_names : tuple of str
        Name of each label index.
    split_column : int
        The first column of the right half; both halves contain every label of the map, except
        very rare ones.
    name : str
        Name of the building.
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    label_names: tuple[str, ...]
    split_column: int
    name: str

    def __post_init__(self) -> None:
        set_frozen(self, labels=self.labels)


@dataclass(frozen=True)
class _Size:
    """Lengths in centimetres of full and small floors."""

    wing_cm: tuple[int, int]
    height_cm: int
    kinds: tuple[str, ...]


_SIZES = {
    "floor": _Size((2600, 3100), 2400, ("tee", "bend", "spine", "loop")),
    "small": _Size((720, 860), 820, ("spine",)),
}


@public
def generate_building(
    seed: int = 0,
    *,
    resolution_m: float | None = None,
    wings: int = 2,
    size: Literal["floor", "small"] = "floor",
    style: StyleName = "office",
    furniture: bool = True,
    slam_noise: bool = True,
    halls: HallsAs = "corridor",
) -> LabelledBuilding:
    """A building drawn from a seed: the same cells on every platform, another building per seed.

    Corridors run straight, branch, turn or close a loop; rooms lie along them, from cells to gyms;
    doors have leaves more or less open. A simulated tour with a laser then decides what is free,
    occupied or unknown.

    A space through which one passes to reach several rooms is circulation. Lobbies, foyers and
    waiting areas are such spaces: halls. They count as corridor unless ``halls`` says otherwise.

    Parameters
    ----------
    seed : int
        Which building; not negative.
    resolution_m : float or None
        Side of a cell, 0.02 to 0.2 m in whole millimetres; 0.05, or 0.1 for a small building.
    wings : int
        How many wings, each about 28 m long; at least one.
    size : str
        ``"floor"`` (wings of about 28 x 24 m) or ``"small"`` (8 x 8 m: for quick tests).
    style : str
        ``"office"``; or, for floors only, ``"varied"``: corridors of 1.2 to 3.8 m, rooms from cells
        to halls, doors of 0.7 to 1.8 m, drawn for each building; or a kind of building:
        ``"apartment"``, ``"atrium"``, ``"cells"``, ``"clinic"``, ``"hall"``, ``"home"``,
        ``"hotel"``, ``"lab"``, ``"mall"``, ``"museum"``, ``"open-plan"``, ``"passage"``,
        ``"ring"``, ``"school"``, ``"suite"``, ``"university"``, with the sizes that real ones have.
    furniture : bool
        Whether the building is furnished.
    slam_noise : bool
        Whether poses and ranges err, panes let rays through, and the map is slightly bent.
    halls : str
        What halls are labelled: ``"corridor"``, ``"room"``, or ``"hall"``, a fourth label. Offices
        and varied buildings have none.

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
    scale = MetreScale(_millimetres(resolution_m, size))
    shape, plan, split, drawn = _draw_plan(seed, scale, style, _SIZES[size], wings)
    margin = scale.cells(drawn.doorway_margin_cm)
    labels = _truth(margin, plan, shape, _HALL if halls == "hall" else LABEL_NAMES.index(halls))
    solid = _walls(plan, shape)
    glass = ~_open(plan.windows, shape) & solid
    hang_doors(Dice(seed, 1, scale), plan, solid)
    if furniture:
        furnish(Dice(seed, 2, scale), plan, solid)
        if drawn.large_furniture:
            amounts = [drawn.large_furniture] * len(plan.rooms)
            furnish_largely(Dice(seed, 6, scale), plan, solid, amounts)
    cells = survey(Dice(seed, 3, scale), plan, solid, glass, noise=slam_noise)
    if slam_noise:
        cells, labels = shifted(Dice(seed, 4), cells, labels)
    span = mapped_span(cells, scale.cells(_MARGIN_CM))
    cells, labels = cells[span], labels[span]
    labels[~main_component(cells == FREE)] = -1
    if split is None:
        span = mapped_span(cells.T, scale.cells(_MARGIN_CM))
        cells, labels = cells[:, span], labels[:, span]
        split = fair_split(labels)
    grid = OccupancyGrid(cells, scale.mm_per_cell / 1000)
    names = (*LABEL_NAMES, "hall") if halls == "hall" else LABEL_NAMES
    return LabelledBuilding(grid, labels, names, split, f"generated building {seed}")


def _check(seed: int, wings: int, size: str, style: str) -> None:
    if seed < 0:
        raise InputError(f"seed must not be negative, got {seed}")
    require_at_least("wings", wings, 1)
    if style != "office" and size != "floor":
        raise InputError(f"style {style!r} needs size 'floor', got size {size!r}")


def _millimetres(resolution_m: float | None, size: str) -> int:
    if resolution_m is None:
        return 100 if size == "small" else 50
    if not _FINEST_M <= resolution_m <= _COARSEST_M:
        raise InputError(
            f"resolution_m must be {_FINEST_M:g} to {_COARSEST_M:g} m, got {resolution_m}"
        )
    return round(1000 * resolution_m)


def _draw_plan(
    seed: int, scale: MetreScale, style: str, size: _Size, wings: int
) -> tuple[tuple[int, int], FloorPlan, int | None, Style]:
    """Shape of the raster, plan in its cells, split column of a building of wings, its style."""
    if style not in KINDS:
        drawn = OFFICE if style == "office" else draw_style(Dice(seed, 5))
        return *_draw_wings(Dice(seed, 0, scale), drawn, size, wings), drawn
    dice = Dice(
        seed, crc32(style.encode()), scale
    )  # a school and a clinic of one seed are not alike
    kind = style_of_kind(dice, style)
    length = sum(dice.integer(*size.wing_cm) for _ in range(wings))
    layout = draw_layout(dice, kind, length * dice.integer(*kind.length_percent) // 100)
    width, height = (scale.cells(cm + kind.rooms_cm.deepest) for cm in layout.size)
    plan = draw_floor(dice, kind, layout, (height, width))
    margin = scale.cells(_MARGIN_CM)
    return (height + 2 * margin, width + 2 * margin), plan.moved(margin, margin), None, kind


def _draw_wings(
    dice: Dice, style: Style, size: _Size, wings: int
) -> tuple[tuple[int, int], FloorPlan, int]:
    margin, height = dice.cells(_MARGIN_CM), dice.cells(style.height_cm or size.height_cm)
    y = height // 2 - dice.cells(110)
    x, plan, edges = 0, FloorPlan(), []
    for index, kind in enumerate(_kinds(dice, size.kinds, wings)):
        edges.append(x)
        length, width = (dice.length(*size.wing_cm), dice.length(*style.corridor_cm))
        wing = Wing(x, x + length, height, min(y, height - width), width, dice.cells(20))
        drawn, y = draw_wing(dice, style, wing, kind)
        plan.add(drawn)
        if index and dice.chance(2, 3):
            plan.add(partition(dice, wing.entrance))
        x += length
    split = edges[wings // 2] if wings > 1 else x // 2
    return (height + 2 * margin, x + 2 * margin), plan.moved(margin, margin), split + margin


def _kinds(dice: Dice, kinds: tuple[str, ...], wings: int) -> list[str]:
    """A kind per wing; kinds repeat only after all have been used."""
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
    """(H, W) mask of the solid cells of the empty building."""
    solid = _open(plan.corridors + plan.rooms + plan.halls, shape)
    for wall in plan.walls:
        solid[wall.slices] = True
    for door in plan.doors:
        solid[door.gap.slices] = False
    return solid


def _truth(margin: int, plan: FloorPlan, shape: tuple[int, int], hall: int) -> NDArray[np.int16]:
    """(H, W) label of each cell of the empty building, -1 in walls; ``hall`` is that of halls."""
    # A doorway reaches margin cells before and behind its wall.
    labels = np.full(shape, -1, np.int16)
    for label, parts in ((_ROOM, plan.rooms), (_CORRIDOR, plan.corridors), (hall, plan.halls)):
        for part in parts:
            labels[part.slices] = label
    for door in plan.doors:
        labels[door.region(margin).slices] = _DOORWAY
    return labels


def fair_split(labels: NDArray[np.int16]) -> int:
    """The column nearest to the middle with every label of LABEL_NAMES on both sides of it.

    Labels that nothing has do not count: a small building may have no corridor, and a survey may
    see no room.
    """
    of_label = [np.flatnonzero((labels == k).any(axis=0)) for k in range(len(LABEL_NAMES))]
    columns = [some for some in of_label if len(some)]
    if not columns:
        return labels.shape[1] // 2
    first, last = max(c[0] for c in columns) + 1, min(c[-1] for c in columns)
    return int(np.clip(labels.shape[1] // 2, first, max(first, last)))
