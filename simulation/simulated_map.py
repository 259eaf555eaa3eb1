"""Simulated maps: robot-like maps of labelled plans."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places._checks import require_names
from pgm_places.errors import InputError, LabelError
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.simulation.distortion import pushed
from pgm_places.simulation.floor_plan import FloorPlan, Rect, sides, windows
from pgm_places.simulation.furniture import FULL, furnish, furnish_largely, hang_doors
from pgm_places.simulation.map_simulation import MapSimulation
from pgm_places.simulation.mapping_effects import (
    BEYOND_CM,
    close_doors,
    forget_glimpses,
    fronts,
    open_ground,
    windows_out,
)
from pgm_places.simulation.plan_reading import ReadPlan, read_plan
from pgm_places.simulation.portable_random import Dice, MetreScale
from pgm_places.simulation.routes import Routes, draw_routes
from pgm_places.simulation.simulated_mapping import (
    N_RAYS,
    Tour,
    budgets,
    main_component,
    mapped,
    mapped_span,
)

_MARGIN_CM = 100
"""Width of the unknown space around a map."""

_PADDING = 3
"""Cells around the plan: the outermost lose every ray, and a wall may stand at the plan's edge.

Where there are windows, the ground outside is added.
"""

_KNOT_CM = 600
"""Distance after which the drift changes its direction."""


@public
def simulate_map(
    plan: LabelledMap,
    label_names: Sequence[str],
    *,
    seed: int = 0,
    options: MapSimulation | None = None,
    resolution_m: float | None = None,
) -> LabelledMap:
    """A robot-like map of a labelled plan, with the plan's labels.

    The plan is scaled and furnished, a robot drives through it with a laser that errs, and its map
    is bent and rotated. A seed gives equal cells on every platform. Train on such maps in addition
    to their plans, not instead of them.

    Parameters
    ----------
    plan : LabelledMap
        A clean map with labels, such as one drawn from CAD. Only its window is used.
    label_names : sequence of str
        The names of its labels.
    seed : int
        Seed of the map; not negative.
    options : MapSimulation, optional
        How the maps may differ.
    resolution_m : float, optional
        Side of a cell; by default that of the plan's, times ``scale`` and ``cell`` as drawn.

    Returns
    -------
    LabelledMap
        Of the same building as the plan, so that both are on one side of a cross-validation. Only
        free cells that are connected with most of the others have labels.

    Raises
    ------
    InputError
        The seed is negative, the resolution is not positive, or the robot fits nowhere.
    LabelError
        The plan has no labels, or labels without a name.

    Examples
    --------
    >>> from pgm_places.simulation import generate_building
    >>> drawn = generate_building(1, size="small", furniture=False, slam_noise=False)
    >>> mapped = simulate_map(LabelledMap(drawn.grid, drawn.labels), drawn.label_names, seed=5)
    >>> bool((mapped.labels[~mapped.grid.free] == -1).all())
    True
    """
    options = options or MapSimulation()
    _check(plan, label_names, seed, resolution_m)
    cells, labels, resolution_m = _resampled(Dice(seed, 20), plan, options, resolution_m)
    scale = MetreScale(max(1, round(1000 * resolution_m)))
    solid = cells != FREE
    passages, doorways = (
        [index for index, name in enumerate(label_names) if name in names]
        for names in (options.passages, options.doorways)
    )
    read = read_plan(scale, labels, solid, passages=passages, doorways=doorways)
    is_doorway, is_passage = np.isin(labels, doorways), np.isin(labels, passages)
    is_room = (labels >= 0) & ~is_doorway & ~is_passage
    seen_through = _gaps(Dice(seed, 27, scale), read, solid, is_passage, options)
    if options.closed_doors[1] > 0:
        dice = Dice(seed, 25, scale)
        share = round(1000 * _between(dice, options.closed_doors))
        doors = close_doors(dice, read.doors, solid, labels, is_doorway, share)
        read = replace(read, doors=doors)
    _furnish(Dice(seed, 21, scale), read, solid, options)
    _furnish_largely(Dice(seed, 26, scale), read, solid, options)
    mapped_cells = _survey(seed, scale, read, solid, seen_through, options)
    if options.least_seen > 0:
        forget_glimpses(labels, mapped_cells, is_room, is_doorway, options.least_seen)
    _add_specks(Dice(seed, 23), mapped_cells, options)
    mapped_cells, labels = _bent(Dice(seed, 24, scale), mapped_cells, labels, options)
    labels[~main_component(mapped_cells == FREE)] = -1
    margin = scale.cells(_MARGIN_CM)
    span = mapped_span(mapped_cells, margin), mapped_span(mapped_cells.T, margin)
    return LabelledMap(
        OccupancyGrid(mapped_cells[span], resolution_m),
        labels[span],
        name=f"{plan.name} (simulated {seed})",
        building=plan.building or plan.name,
    )


def _check(
    plan: LabelledMap, label_names: Sequence[str], seed: int, resolution_m: float | None
) -> None:
    if seed < 0:
        raise InputError(f"seed must not be negative, got {seed}")
    if resolution_m is not None and not (np.isfinite(resolution_m) and resolution_m > 0):
        raise InputError(f"resolution_m must be a positive length in metres, got {resolution_m}")
    if not plan.labelled_cells.any():
        raise LabelError(f"{plan.name}: no free cell has a label; the plan's places are needed")
    require_names(plan.name, plan.labels, label_names)


def _between(dice: Dice, limits: tuple[float, float]) -> float:
    """One of a thousand values between two; plain arithmetic, the same on every platform."""
    low, high = limits
    return low + (high - low) * dice.integer(0, 1000) / 1000


def _resampled(
    dice: Dice, plan: LabelledMap, options: MapSimulation, resolution_m: float | None
) -> tuple[NDArray[np.int8], NDArray[np.int16], float]:
    """Cells and labels of the scaled plan, resampled, with a margin; and the side of a cell."""
    larger, factor = _between(dice, options.scale), _between(dice, options.cell)
    if resolution_m is None:
        resolution_m = plan.grid.resolution_m * larger * factor
    else:
        factor = resolution_m / (plan.grid.resolution_m * larger)
    cells, labels = plan.grid.cells, np.where(plan.labelled_cells, plan.labels, -1)
    at = [_centres(length, factor) for length in cells.shape]
    grid = np.ix_(*at)
    fine, found = cells[grid], labels[grid]
    rows, columns = np.nonzero(cells == OCCUPIED)
    last = np.array(fine.shape) - 1
    to = np.floor(np.column_stack([rows + 0.5, columns + 0.5]) / factor).astype(np.int64)
    to = np.minimum(to, last)
    fine[to[:, 0], to[:, 1]] = OCCUPIED
    found[fine != FREE] = -1
    around = _PADDING
    if options.windows[1] > 0:
        around += round(BEYOND_CM / (100 * resolution_m))
    return (
        np.pad(fine, around, constant_values=UNKNOWN),
        np.pad(found, around, constant_values=-1).astype(np.int16),
        resolution_m,
    )


def _centres(length: int, factor: float) -> NDArray[np.int64]:
    """For each new cell along a side, the cell that holds its centre."""
    n_cells = max(1, int(length / factor + 0.5))
    at = np.floor((np.arange(n_cells) + 0.5) * factor).astype(np.int64)
    return np.minimum(at, length - 1)


def _furnish(dice: Dice, read: ReadPlan, solid: NDArray[np.bool_], options: MapSimulation) -> None:
    """Hang the doors, furnish some rooms, and put something into the corridors."""
    empty, usual = (
        round(FULL * _between(dice, span)) for span in (options.empty_rooms, options.furniture)
    )
    in_rooms = []
    for room in read.rooms:
        amount = 0 if dice.chance(empty, FULL) else usual * dice.integer(500, 1500) // 1000
        in_rooms += [amount] * len(room)
    plan = read.floor_plan()
    hang_doors(dice, plan, solid)
    in_corridors = round(FULL * _between(dice, options.corridor_furniture))
    furnish(dice, plan, solid, in_rooms=in_rooms, in_corridors=in_corridors)


def _furnish_largely(
    dice: Dice, read: ReadPlan, solid: NDArray[np.bool_], options: MapSimulation
) -> None:
    """Put furniture that looks like walls into the largest rectangle of each room."""
    usual = round(FULL * _between(dice, options.large_furniture))
    if usual:
        rooms = [room[0] for room in read.rooms if room]
        amounts = [usual * dice.integer(0, 1500) // 1000 for _ in rooms]
        furnish_largely(dice, FloorPlan(rooms=rooms, doors=read.doors), solid, amounts)


def _gaps(
    dice: Dice,
    read: ReadPlan,
    solid: NDArray[np.bool_],
    is_passage: NDArray[np.bool_],
    options: MapSimulation,
) -> NDArray[np.bool_]:
    """(H, W) cells that are solid for the robot but not for its laser."""
    outer, inner = (
        round(1000 * _between(dice, span)) for span in (options.windows, options.glass_fronts)
    )
    gaps = np.zeros_like(solid)
    if inner:
        gaps |= fronts(dice, read.rooms, is_passage, inner)
    if outer:
        ground = open_ground(dice, solid)
        gaps |= windows_out(dice, (*read.rooms, *read.passages), ground, outer) | ground
    return gaps


def _survey(
    seed: int,
    scale: MetreScale,
    read: ReadPlan,
    solid: NDArray[np.bool_],
    gaps: NDArray[np.bool_],
    options: MapSimulation,
) -> NDArray[np.int8]:
    """(H, W) cells as the robot maps them; its laser sees through ``gaps``."""
    dice = Dice(seed, 22, scale)
    enters = round(1000 * _between(dice, options.entered_rooms))
    routes = draw_routes(
        dice,
        solid,
        [room for room in read.rooms if dice.chance(enters, 1000)],
        read.passages,
        n_routes=dice.integer(*options.routes),
        coverage=_between(dice, options.coverage),
    )
    n_rays = len(routes.stations) * N_RAYS
    glazed = round(1000 * _between(dice, options.glass))
    tour = Tour(
        routes.stations,
        _pose_errors(dice, routes, _between(dice, options.pose_noise_m))
        + _slip(Dice(seed, 28, scale), len(routes.stations), options),
        budgets(dice, n_rays, opacity=dice.integer(1, 6)),
        _range_errors(dice, n_rays, _between(dice, options.range_noise_m)),
    )
    glass = _panes(dice, read.rooms, glazed, solid)
    reach = scale.cells(round(100 * _between(dice, options.reach_m)))
    return mapped(tour, solid & ~gaps, glass & ~gaps, reach=reach)


def _panes(
    dice: Dice, rooms: Sequence[list[Rect]], glazed: int, solid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(H, W) panes in the walls of ``glazed`` rooms of a thousand."""
    glass = np.zeros_like(solid)
    for rect in (room[0] for room in rooms if room and dice.chance(glazed, 1000)):
        for side in sides(rect):
            for pane in windows(dice, side, (0, side.length), 0):
                glass[pane.within(glass.shape).slices] = True
    return glass & solid


def _pose_errors(dice: Dice, routes: Routes, most_m: float) -> NDArray[np.int64]:
    """(S, 2) pose errors in columns and rows: a random walk that restarts with each route."""
    most = round(1000 * most_m / dice.scale.mm_per_cell)
    n_stations = len(routes.route)
    steps = dice.integers(-_SELDOM, _SELDOM, 2 * n_stations).reshape(-1, 2)
    moves = (steps == _SELDOM).astype(np.int64) - (steps == -_SELDOM)
    offsets = np.zeros((n_stations, 2), np.int64)
    here = np.zeros(2, np.int64)
    for station in range(n_stations):
        if station and routes.route[station] != routes.route[station - 1]:
            here = dice.integers(-most, most, 2)
        here = np.clip(here + moves[station], -most, most)
        offsets[station] = here
    return offsets


def _slip(dice: Dice, n_stations: int, options: MapSimulation) -> NDArray[np.int64]:
    """(S, 2) displacement in columns and rows of the drive from a random station on."""
    most = round(1000 * _between(dice, options.slip_m) / dice.scale.mm_per_cell)
    offsets = np.zeros((n_stations, 2), np.int64)
    if most:
        first, last = sorted(dice.integer(0, n_stations) for _ in range(2))
        far = dice.choice((-most, most))
        offsets[first:last] = dice.shuffled((far, dice.integer(-most, most)))
    return offsets


_SELDOM = 6
"""At two in 13 stations the error of the pose grows or shrinks by a cell in each direction."""


def _range_errors(dice: Dice, n_rays: int, sigma_m: float) -> NDArray[np.int64]:
    """(R,) cells by which a ray is reported too long: nearly gaussian, the sum of four dice."""
    total = dice.integers(-_DIE, _DIE, 4 * n_rays).reshape(4, -1).sum(axis=0)
    sigma = round(_DIE * 1000 * sigma_m / dice.scale.mm_per_cell)  # of a die's side to a cell's
    # Four dice of -n to n have a variance of 4 n (n + 1) / 3, about (1.155 n)^2.
    return (2 * total * sigma * 1000 + 1155 * _DIE * _DIE) // (2 * 1155 * _DIE * _DIE)


_DIE = 1000


def _add_specks(dice: Dice, cells: NDArray[np.int8], options: MapSimulation) -> None:
    """Make some free cells, one to four side by side, unknown or occupied."""
    free = np.flatnonzero(cells == FREE)
    n_specks = round(_between(dice, options.specks) * len(free))
    for kind in (UNKNOWN, OCCUPIED):
        at = free[dice.integers(0, len(free) - 1, n_specks // 2)]
        wide = dice.integers(0, 1, n_specks // 2)
        for step in (0, 1, cells.shape[1]):
            there = np.minimum(at + step * wide, cells.size - 1)
            cells.ravel()[there[cells.ravel()[there] == FREE]] = kind


def _bent(
    dice: Dice, cells: NDArray[np.int8], labels: NDArray[np.int16], options: MapSimulation
) -> tuple[NDArray[np.int8], NDArray[np.int16]]:
    """Cells and labels, bent and turned alike."""
    turn, quarters = _between(dice, options.turn_degrees), 0
    if dice.chance(round(1000 * options.oblique), 1000):
        turn, quarters = _between(dice, (-45, 45)), dice.integer(0, 3)
    bend = pushed(
        dice,
        cells.shape,
        knot=dice.cells(_KNOT_CM),
        bend=_between(dice, options.bend),
        turn_degrees=turn,
    )
    return (
        np.rot90(bend.apply(cells, UNKNOWN), quarters).copy(),
        np.rot90(bend.apply(labels, -1), quarters).copy(),
    )
