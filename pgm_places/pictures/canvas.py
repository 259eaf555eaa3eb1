"""Paletted pictures of maps, labels and graphs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import palette
from pgm_places._checks import finite_array, freeze, require_shape, row_blocks
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout, painted
from pgm_places.io.maps.raster_image import encoded
from pgm_places.maps.coarsening import Coarsening
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.trajectories.path import PathLayout

if TYPE_CHECKING:
    from PIL import Image


SIDE = 1000
"""Cells along the longer side of a drawing."""

DOT_SHARE = 0.3
"""Radius of a dot over the distance between the nodes if they were spread evenly."""

LARGEST_DOT, SMALLEST_DOT = 17.0, 2.0
"""Largest and smallest radius of dots in cells."""

_MARGIN = int(np.ceil(LARGEST_DOT)) + 2

MOST_SPRINGS = 3000
"""Most nodes of a spring layout; larger graphs are drawn on circles, one per component."""

MOST_EDGES = 30_000
"""Most edges drawn; more would cover the nodes."""


@dataclass(frozen=True, eq=False)
class GraphLayout:
    """The nodes of a graph as dots, at their positions or by a spring layout, over the edges.

    The counterpart of :class:`~pgm_places.graph.layout.GridLayout`, with edges drawn as walls.

    Examples
    --------
    >>> line = LabelGraph.from_edges(2, [(0, 1)], positions_m=[[0.0, 0.0], [1.0, 0.0]])
    >>> layout = GraphLayout(line)
    >>> raster = layout.to_raster([7, 8], fill=-1)
    >>> row, column = layout.cells_rc[1]
    >>> int(raster[row, column]), layout.grid.shape == raster.shape
    (8, True)
    """

    graph: LabelGraph

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        return self.grid.shape

    @cached_property
    def cells_rc(self) -> NDArray[np.int64]:
        """(N, 2) row and column of each dot's centre."""
        xy = _places(self.graph)
        span = np.ptp(xy, axis=0)
        scale = (SIDE - 1) / max(float(span.max(initial=0.0)), 1e-12)
        cells = np.rint((xy - xy.min(axis=0)) * scale).astype(np.int64) + _MARGIN
        return freeze(np.ascontiguousarray(cells[:, ::-1]))

    @cached_property
    def node_of_cell(self) -> NDArray[np.int32]:
        """(H, W) the node drawn at each cell, -1 outside the dots."""
        raster = np.full(self.cells_rc.max(axis=0) + _MARGIN + 1, -1, np.int32)
        n_nodes = self.graph.n_nodes
        radius = np.clip(DOT_SHARE * SIDE / np.sqrt(n_nodes), SMALLEST_DOT, LARGEST_DOT)
        reach = int(np.ceil(radius))
        side = np.arange(-reach, reach + 1)
        brush = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
        brush = brush[(brush**2).sum(axis=1) <= radius**2]
        # From the rim inwards, so that the centre of each dot is visible where dots overlap.
        for offset in brush[np.argsort(-(brush**2).sum(axis=1), kind="stable")]:
            rows, columns = (self.cells_rc + offset).T
            raster[rows, columns] = np.arange(n_nodes, dtype=np.int32)
        return freeze(raster)

    @cached_property
    def grid(self) -> OccupancyGrid:
        """The drawing as a map: dots are free, edges are walls, the rest is unknown."""
        cells = np.full(self.node_of_cell.shape, UNKNOWN, np.int8)
        if self.graph.n_edges <= MOST_EDGES:
            for first, second in self.cells_rc[self.graph.edges]:
                rows, columns = _line(first, second)
                cells[rows, columns] = OCCUPIED
        cells[self.node_of_cell >= 0] = FREE
        return OccupancyGrid(cells, resolution_m=1.0 / SIDE)

    def to_raster(self, values: ArrayLike, *, fill: Any) -> NDArray[Any]:
        """Values (N, ...) of the nodes on the raster (H, W, ...); ``fill`` outside the dots."""
        return painted(self.node_of_cell, self.graph.n_nodes, values, fill)

    def from_raster(self, raster: ArrayLike) -> NDArray[Any]:
        """The raster's values (H, W, ...) at the dots' centres (N, ...)."""
        array = np.asarray(raster)
        require_shape("the raster", array.shape[:2], self.shape)
        rows, columns = self.cells_rc.T
        gathered: NDArray[Any] = array[rows, columns]
        return gathered


def _places(graph: LabelGraph) -> NDArray[np.float64]:
    """(N, 2) positions of the nodes in the drawing."""
    if graph.positions_m is not None:
        return graph.positions_m[:, :2]
    if graph.is_chain:  # row below row, as text is written
        per_row = int(np.ceil(np.sqrt(4 * graph.n_nodes)))
        at = np.arange(graph.n_nodes)
        return np.stack([at % per_row, -4.0 * (at // per_row)], axis=1).astype(np.float64)
    if graph.n_nodes > MOST_SPRINGS:
        turn = 2 * np.pi * np.arange(graph.n_nodes) / graph.n_nodes
        return np.stack([np.cos(turn), np.sin(turn)], axis=1)
    import networkx as nx

    plain: nx.Graph[int] = nx.empty_graph(graph.n_nodes)
    plain.add_edges_from(graph.edges.tolist())
    found = nx.spring_layout(plain, seed=0)
    xy = np.array([found[node] for node in range(graph.n_nodes)], np.float64)
    return xy if np.ptp(xy[:, 0]) >= np.ptp(xy[:, 1]) else xy[:, ::-1]


def _line(first: NDArray[np.int64], second: NDArray[np.int64]) -> tuple[Any, Any]:
    """Rows and columns of the cells between two, both included."""
    steps = int(np.abs(second - first).max()) + 1
    rows, columns = np.rint(np.linspace(first, second, steps)).astype(np.int64).T
    return rows, columns


_UNKNOWN, _WALL, _IGNORED, _STRIPE, _FIRST = range(5)
_GROUND = (palette.UNKNOWN, palette.WALL, palette.IGNORED, palette.IGNORED_STRIPE)

Window = tuple[slice, slice]
"""Rows and columns of a map."""

N_LEVELS = 24
"""Steps of probability and entropy: finer steps are invisible and enlarge files."""

_GROUND_WEIGHTS = (1, 3, 1)
_LABEL_WEIGHT, _STRONG_WEIGHT = 2, 4
"""Weights of unknown, wall, free without a label, and labels when a map is shrunk: a block of cells
shows the kind with the largest weighted count. Walls and errors, which are thin, weigh most."""


@dataclass(frozen=True)
class View:
    """The displayed window of a map, and the cells along the side of a pixel."""

    rows: slice
    columns: slice
    shrink: int = 1

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the picture in pixels."""
        rows = self.rows.stop - self.rows.start
        columns = self.columns.stop - self.columns.start
        return -(-rows // self.shrink), -(-columns // self.shrink)

    def pixels_at_m(self, grid: OccupancyGrid, positions_m: ArrayLike) -> NDArray[np.float64]:
        """(n, 2) pixels of map-frame positions, x to the right and y down."""
        corner = np.array([self.columns.start, self.rows.start])
        x, y = ((grid.points_at_m(positions_m) - corner) / self.shrink).T
        return np.stack([x, self.shape[0] - y], axis=1)


@dataclass(frozen=True, eq=False)
class Canvas:
    """A paletted image (h, w); row 0 is the top, as in every image."""

    indices: NDArray[np.uint8]
    colours: tuple[str, ...]
    m_per_pixel: float

    def image(self) -> "Image.Image":
        """The image with its palette, for Pillow."""
        from PIL import Image

        image = Image.fromarray(self.indices)
        image.putpalette(b"".join(palette.rgb_of(colour).tobytes() for colour in self.colours))
        return image

    def png(self) -> bytes:
        """The image as a PNG file, one pixel per pixel."""
        return encoded(self.image(), optimize=True)


def view_of(
    grid: OccupancyGrid, shown: NDArray[np.bool_] | None = None, *, most_pixels: int
) -> View:
    """The window of the known cells, or of ``shown`` (H, W), and 0.5 m; at most ``most_pixels``."""
    raster = grid.cells if shown is None or not shown.any() else shown
    nothing = UNKNOWN if raster is grid.cells else False
    in_row = np.zeros(grid.shape[0], np.bool_)
    in_column = np.zeros(grid.shape[1], np.bool_)
    for band in bands_of_rows(grid.shape):
        used = raster[band] != nothing
        in_row[band] = used.any(axis=1)
        in_column |= used.any(axis=0)
    rows, columns = _span(in_row, grid), _span(in_column, grid)
    cells = (rows.stop - rows.start) * (columns.stop - columns.start)
    shrink = max(1, int(np.ceil(np.sqrt(cells / most_pixels))))
    return View(rows, columns, shrink)


def _span(used: NDArray[np.bool_], grid: OccupancyGrid) -> slice:
    where = np.flatnonzero(used)
    if not len(where):
        return slice(0, len(used))
    margin = max(2, round(0.5 / grid.resolution_m))
    return slice(max(0, int(where[0]) - margin), min(len(used), int(where[-1]) + 1 + margin))


def label_canvas(
    grid: OccupancyGrid, labels: NDArray[np.integer], label_names: Sequence[str], view: View
) -> Canvas:
    """Labels (H, W), -1 for none, in their colours over walls and unknown space."""
    return _canvas(labels.__getitem__, palette.label_colours(label_names), view, grid)


def difference_canvas(
    grid: OccupancyGrid,
    truth: NDArray[np.integer],
    predicted: NDArray[np.integer],
    label_names: Sequence[str],
    view: View,
) -> Canvas:
    """Where the prediction is wrong, in one strong colour over pale correct labels."""
    colours = palette.label_colours(label_names)
    pale, wrong = (palette.tinted(each, palette.RIGHT_TINT) for each in colours), len(label_names)

    def compared(cells: Window) -> NDArray[np.integer]:
        true, label = truth[cells], predicted[cells]
        return np.where(label < 0, -1, np.where((true >= 0) & (true != label), wrong, true))

    return _canvas(compared, (*pale, palette.ERROR), view, grid, strong=_FIRST + wrong)


def value_canvas(
    grid: OccupancyGrid,
    values: ArrayLike | Callable[[slice], NDArray[np.float64]],
    layout: GridLayout | PathLayout | GraphLayout,
    gradient: str,
    view: View,
) -> Canvas:
    """Values 0 to 1 of nodes (N,), or a function of a range of nodes, as colours over the map."""
    n_nodes = layout.n_nodes if isinstance(layout, GridLayout) else len(layout.cells_rc)
    raster = layout.to_raster(_steps(values, n_nodes), fill=np.int8(-1))
    if isinstance(layout, GridLayout):
        coarsening = Coarsening.behind(layout, grid)
    else:
        coarsening = Coarsening(grid, grid)

    def steps(cells: Window) -> NDArray[np.integer]:
        return coarsening.paint(raster, -1, rows=cells[0])[:, cells[1]]

    return _canvas(steps, palette.levels(gradient, N_LEVELS), view, grid, averaged=True)


def _steps(
    values: ArrayLike | Callable[[slice], NDArray[np.float64]], n_nodes: int
) -> NDArray[np.int8]:
    """(N,) the step of the gradient for each value."""
    part_of = values
    if not callable(part_of):
        part_of = finite_array("values", part_of, (n_nodes,)).__getitem__
    steps = np.empty(n_nodes, np.int8)
    for some in row_blocks(n_nodes):
        steps[some] = np.clip(part_of(some) * N_LEVELS, 0, N_LEVELS - 1)
    return steps


def _painted(
    grid: OccupancyGrid, shown: Callable[[Window], NDArray[np.integer]], cells: Window
) -> NDArray[np.uint8]:
    """Colour indices of cells: unknown, wall, free without a label, or the label."""
    part, over = grid.cells[cells], shown(cells)
    picture = np.full(part.shape, _UNKNOWN, np.uint8)
    picture[part == OCCUPIED] = _WALL
    picture[part == FREE] = _IGNORED
    chosen = (over >= 0) & (part == FREE)
    picture[chosen] = (over[chosen] + _FIRST).astype(np.uint8)
    return picture


def _canvas(
    shown: Callable[[Window], NDArray[np.integer]],
    own_colours: Iterable[str],
    view: View,
    grid: OccupancyGrid,
    *,
    strong: int | None = None,
    averaged: bool = False,
) -> Canvas:
    """The view, painted band by band, shrunk, striped and flipped to have y upwards."""
    # shown gives an index into own_colours for each cell of a window, or -1.
    colours = (*_GROUND, *own_colours)
    height, width = view.shape
    picture = np.empty((height, width), np.uint8)
    columns = view.columns.stop - view.columns.start
    for band in bands_of_rows((view.rows.stop - view.rows.start, columns), multiple=view.shrink):
        rows = slice(view.rows.start + band.start, view.rows.start + band.stop)
        first = band.start // view.shrink
        painted = _painted(grid, shown, (rows, view.columns))
        if view.shrink > 1:
            painted = _shrunk(painted, view.shrink, len(colours), strong, averaged=averaged)
        picture[first : first + len(painted)] = painted
    diagonal = (np.arange(height)[:, None] + np.arange(width)[None, :]) % 4 == 0
    picture[(picture == _IGNORED) & diagonal] = _STRIPE
    return Canvas(picture[::-1], colours, grid.resolution_m * view.shrink)


def _shrunk(
    painted: NDArray[np.uint8], shrink: int, n_colours: int, strong: int | None, *, averaged: bool
) -> NDArray[np.uint8]:
    """Each block of ``shrink`` x ``shrink`` pixels as one: its weightiest kind, then label."""
    height, width = painted.shape
    short, narrow = -height % shrink, -width % shrink
    padded = np.pad(painted, ((0, short), (0, narrow)), constant_values=_UNKNOWN)
    blocks = padded.reshape(padded.shape[0] // shrink, shrink, padded.shape[1] // shrink, shrink)

    def count(index: int) -> NDArray[np.int32]:
        return np.asarray((blocks == index).sum(axis=(1, 3), dtype=np.int32))

    best = np.full((blocks.shape[0], blocks.shape[2]), -1, np.int32)
    kind = np.zeros(best.shape, np.uint8)
    for index, weight in enumerate(_GROUND_WEIGHTS):
        weighted = weight * count(index)
        kind[weighted > best] = index
        best = np.maximum(best, weighted)
    labelled = (blocks >= _FIRST).sum(axis=(1, 3), dtype=np.int32)
    chosen = _LABEL_WEIGHT * labelled > best
    if averaged:
        total = np.where(blocks >= _FIRST, blocks, 0).sum(axis=(1, 3), dtype=np.int64)
        label = np.round(total / np.maximum(labelled, 1)).astype(np.uint8)
    else:
        label, most = np.zeros(best.shape, np.uint8), np.zeros(best.shape, np.int32)
        for index in range(_FIRST, n_colours):
            weighted = (_STRONG_WEIGHT if index == strong else 1) * count(index)
            label[weighted > most] = index
            most = np.maximum(most, weighted)
    return np.where(chosen, label, kind).astype(np.uint8)
