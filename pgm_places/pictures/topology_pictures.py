"""Topology pictures: the topological map over the map, and as a diagram (paper Figs. 9, 11)."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import ERROR, label_colours, tinted
from pgm_places.pictures.canvas import Canvas, View, label_canvas, view_of
from pgm_places.pictures.drawing import INK, MUTED, Drawing, text_width
from pgm_places.pictures.figure_grid import draw_scale_bar
from pgm_places.topology.checks import PlaceCheck, places_to_check, split_candidates
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

_SQUARE = 64.0
"""Side in pixels of the squares of the index of boxes: about the length of a name."""


def name_spots(
    names: Sequence[str], discs: ArrayLike, others: ArrayLike, *, size: float, radius: float
) -> NDArray[np.float64]:
    """(N, 2) the middles of N names: below, above or beside their discs, where least is covered.

    Discs (N, 2) and ``others`` (M, 2), marks to keep visible, have the radius ``radius`` in pixels.
    Names are placed one after another, each where it covers the least area of discs, others and
    the names before it.
    """
    points = np.asarray(discs, np.float64).reshape(-1, 2)
    solid = np.concatenate([points, np.asarray(others, np.float64).reshape(-1, 2)])
    taken = _Boxes(np.concatenate([solid - radius, solid + radius], axis=1))
    spots = np.empty_like(points)
    for number, (name, point) in enumerate(zip(names, points, strict=True)):
        half = np.array([text_width(name, size) / 2 + 2, size / 2 + 1])
        down, across = radius + half[1] + 3, radius + half[0] + 1
        ways = np.array([(0, down), (0, -down), (across, 0), (-across, 0)])
        boxes = np.concatenate([point + ways - half, point + ways + half], axis=1)
        best = int(np.argmin(_hidden(boxes, taken.near(boxes))))  # the first of equal ones
        spots[number] = point + ways[best]
        taken.add(boxes[best])
    return spots


class _Boxes:
    """A spatial index of boxes (left, top, right, bottom), by squares of the picture."""

    def __init__(self, boxes: NDArray[np.float64]) -> None:
        self._boxes: list[NDArray[np.float64]] = []
        self._in_square: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
        for box in boxes:
            self.add(box)

    def add(self, box: NDArray[np.float64]) -> None:
        for square in _squares(box):
            self._in_square[square].append(len(self._boxes))
        self._boxes.append(box)

    def near(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, 4) in the order of insertion, at least the boxes that overlap any of some boxes."""
        around = np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])
        numbers = {number for square in _squares(around) for number in self._in_square[square]}
        return np.array([self._boxes[number] for number in sorted(numbers)]).reshape(-1, 4)


def _squares(box: NDArray[np.float64]) -> Iterator[tuple[int, int]]:
    left, top, right, bottom = np.floor(box / _SQUARE).astype(int).tolist()
    for x in range(left, right + 1):
        for y in range(top, bottom + 1):
            yield x, y


def _hidden(boxes: NDArray[np.float64], taken: NDArray[np.float64]) -> NDArray[np.float64]:
    """(B,) area of each box (left, top, right, bottom) that lies on boxes already taken."""
    low = np.maximum(boxes[:, None, :2], taken[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], taken[None, :, 2:])
    sides = (high - low).clip(0)
    return np.asarray(sides.prod(axis=2).sum(axis=1), np.float64)


_MOST_PIXELS = 1_000_000

_LONG_SIDE = 1500

_EDGE, _TITLE, _CAPTION, _FOOT = 24, 40, 26, 44

PALE = 0.45

_LINE, _RADIUS, _NAME = 2.2, 8.5, 14

_MOST_MARKED, _LEAST_DOUBTFUL_M2 = 5, 1.0

_ToPixels: TypeAlias = Callable[[ArrayLike], NDArray[np.float64]]


def topology_drawing(
    grid: OccupancyGrid, topology: TopologicalMap, *, title: str | None = None
) -> Drawing:
    """The topological map over the map, and the diagram next to or below it.

    Nodes stand at the regions' anchors and edges go through the middle of the passages; at
    corridors, and other places with more than six neighbours, they end at the passage. In the
    diagram these keep their shape, every other place is a disc, doorways are squares. Doorways
    that are gates have their rectangles drawn over the map. The places to check first have their
    ids in red, and red lines cross the openings of split candidates.

    Parameters
    ----------
    grid : OccupancyGrid
        The map that the topology was made from.
    topology : TopologicalMap
    title : str or None

    Examples
    --------
    >>> from pgm_places.topology.from_labels import topological_map
    >>> grid = OccupancyGrid([[0, 0, 0]], resolution_m=1.0)
    >>> found = topological_map(grid, [[0, 1, 2]], ["room", "doorway", "corridor"])
    >>> topology_drawing(grid, found).image.mode
    'RGB'
    """
    canvas, scale, pixels = _scaled(grid, topology)
    height, width = canvas.indices.shape
    size = (scale * width, scale * height)
    beside = height > 0.7 * width
    top = _EDGE + (_TITLE if title else 0)
    second = (2 * _EDGE + size[0], top) if beside else (_EDGE, top + _CAPTION + size[1] + _EDGE)
    content = max(second[0] + size[0] - _EDGE, 420)
    page = Drawing(content + 2 * _EDGE, second[1] + _CAPTION + size[1] + _FOOT + _EDGE)
    if title:
        page.text(_EDGE, _EDGE + 10, title, size=20, bold=True)
    caption = "places over the map"
    if checks := marked_checks(topology):
        caption += "; check the places with red numbers first"
    if split_candidates(topology):
        caption += "; split along red lines?"
    page.text(_EDGE, top + 8, caption, size=15, colour=MUTED)
    over = Drawing.of(canvas, scale)
    _draw_gates(over, topology, pixels)
    shaped = {region.id for region in topology.regions if _keeps_shape(region, topology)}
    _draw_edges(over, topology, pixels, shaped, through_passages=True)
    _draw_nodes(over, topology, topology.regions, pixels)
    _draw_checks(over, checks, pixels)
    _draw_splits(over, topology, pixels)
    page.paste(over, _EDGE, top + _CAPTION)
    page.text(second[0], second[1] + 8, count_line(topology), size=15, colour=MUTED)
    diagram = Drawing(*size)
    _draw_diagram(diagram, topology, pixels, shaped)
    page.paste(diagram, second[0], second[1] + _CAPTION)
    below = second[1] + _CAPTION + size[1] + 16
    draw_scale_bar(page, canvas, (_EDGE, below), scale, size=14)
    return page


def places_drawing(grid: OccupancyGrid, topology: TopologicalMap) -> Drawing:
    """The places over the map with their names, doorways as rectangles, and checks in red.

    Parameters
    ----------
    grid : OccupancyGrid
        The map that the topology was made from.
    topology : TopologicalMap
    """
    canvas, scale, pixels = _scaled(grid, topology)
    height, width = canvas.indices.shape
    page = Drawing(scale * width, scale * height + _FOOT)
    over = Drawing.of(canvas, scale)
    _draw_gates(over, topology, pixels)
    others = [each for each in topology.regions if each.label != topology.doorway_label]
    _draw_nodes(over, topology, others, pixels)
    _draw_checks(over, marked_checks(topology), pixels)
    _draw_splits(over, topology, pixels)
    page.paste(over, 0, 0)
    draw_scale_bar(page, canvas, (_EDGE // 2, scale * height + 16), scale, size=14)
    return page


def _scaled(grid: OccupancyGrid, topology: TopologicalMap) -> tuple[Canvas, int, _ToPixels]:
    """The pale map, the factor by which it is enlarged, and positions on the enlarged map."""
    view = view_of(grid, topology.region > 0, most_pixels=_MOST_PIXELS)
    canvas = paled_canvas(grid, topology.labels, topology.label_names, view)
    scale = max(1, _LONG_SIDE // max(canvas.indices.shape))
    return canvas, scale, lambda points_m: scale * view.pixels_at_m(grid, points_m)


def paled_canvas(
    grid: OccupancyGrid, labels: NDArray[np.int16], label_names: Sequence[str], view: View
) -> Canvas:
    """The map with pale label colours: all colours after the four of the ground."""
    canvas = label_canvas(grid, labels, label_names, view)
    pale = (tinted(colour, PALE) for colour in canvas.colours[4:])
    return replace(canvas, colours=(*canvas.colours[:4], *pale))


def _draw_edges(
    panel: Drawing,
    topology: TopologicalMap,
    pixels: _ToPixels,
    shaped: set[int],
    *,
    through_passages: bool,
) -> None:
    for item in topology.connections:
        first, second = (
            item.point_m if number in shaped else topology.place(number).anchor_m
            for number in (item.first, item.second)
        )
        way = [first, item.point_m, second] if through_passages else [first, second]
        panel.line(pixels(way), colour=INK, width=_LINE)


def _draw_gates(panel: Drawing, topology: TopologicalMap, pixels: _ToPixels) -> None:
    for region in topology.regions:
        if region.gate is not None:
            corners = np.asarray(region.gate.corners_m)
            panel.line(pixels([*corners, corners[0]]), colour=INK, width=2)


def _draw_splits(panel: Drawing, topology: TopologicalMap, pixels: _ToPixels) -> None:
    """Draw a line across each opening of the split candidates, and their numbers of rooms."""
    for candidate in split_candidates(topology):
        for line in candidate.lines_m:
            panel.line(pixels(line), colour="white", width=7)
            panel.line(pixels(line), colour=ERROR, width=4)
        ends = pixels(candidate.lines_m[0])
        text = f"{candidate.place.id}: {candidate.count} rooms?"
        x, y = float(ends[:, 0].mean()), float(ends[:, 1].min()) - 14
        panel.text(x, y, text, size=13, bold=True, centred=True, colour=ERROR, halo=2)


def _draw_checks(panel: Drawing, checks: Iterable[PlaceCheck], pixels: _ToPixels) -> None:
    for check in checks:
        [(x, y)] = pixels(check.place.anchor_m)
        number = str(check.place.id)
        panel.disc((x, y), diameter=max(21, 7 + 9 * len(number)), fill=ERROR, edge="white")
        panel.text(x, y, number, size=14, bold=True, centred=True, colour="white")


def _draw_diagram(
    panel: Drawing, topology: TopologicalMap, pixels: _ToPixels, shaped: set[int]
) -> None:
    colours = dict(zip(topology.label_names, label_colours(topology.label_names), strict=True))
    for number in shaped:
        _draw_shape(panel, topology.place(number), pixels, colours)
    _draw_edges(panel, topology, pixels, shaped, through_passages=False)
    others = [region for region in topology.regions if region.id not in shaped]
    _draw_nodes(panel, topology, others, pixels)
    for number in shaped:
        region = topology.place(number)
        _name(panel, region.name, *pixels(region.anchor_m)[0])


def _keeps_shape(region: Region, topology: TopologicalMap) -> bool:
    """Whether a place keeps its shape in the diagram, as corridors with many neighbours do."""
    return region.label != topology.doorway_label and (
        region.label == "corridor" or len(topology.neighbours(region.id)) > 6
    )


def _draw_shape(panel: Drawing, region: Region, pixels: _ToPixels, colours: dict[str, str]) -> None:
    for rings in region.polygons:
        outlines = [pixels(ring) for ring in rings]
        panel.polygon(outlines, fill=tinted(colours[region.label], PALE))
        for outline in outlines:
            panel.line([*outline, outline[0]], colour=MUTED, width=1)


def _draw_nodes(
    panel: Drawing, topology: TopologicalMap, regions: Iterable[Region], pixels: _ToPixels
) -> None:
    colours = dict(zip(topology.label_names, label_colours(topology.label_names), strict=True))
    squares, discs, names = [], [], []
    for region in regions:
        [at] = pixels(region.anchor_m)
        if region.label == topology.doorway_label:
            squares.append(at)
            panel.square(tuple(at), side=10, fill=colours[region.label], edge=INK)
        else:
            discs.append(at)
            names.append(region.name)
            panel.disc(tuple(at), diameter=2 * _RADIUS, fill=colours[region.label], edge=INK)
    spots = name_spots(names, discs, squares, size=_NAME, radius=_RADIUS)
    for name, (x, y) in zip(names, spots, strict=True):
        _name(panel, name, x, y)


def _name(panel: Drawing, name: str, x: float, y: float) -> None:
    panel.text(x, y, name, size=_NAME, centred=True, halo=2)


def marked_checks(topology: TopologicalMap) -> list[PlaceCheck]:
    """The first few places to check: at most five, each with 1 m² uncertain or more."""
    first = places_to_check(topology)[:_MOST_MARKED]
    return [check for check in first if check.doubtful_m2 >= _LEAST_DOUBTFUL_M2]


def count_line(topology: TopologicalMap) -> str:
    """The numbers of places of each class and of connections."""
    parts = []
    for label in topology.label_names:
        count = sum(region.label == label for region in topology.regions)
        parts.append(f"{count} {label}{'' if count == 1 else 's'}")
    n = len(topology.connections)
    return f"{', '.join(parts)}; {n} connection{'' if n == 1 else 's'}"
