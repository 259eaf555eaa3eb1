"""The picture of the conventions: a map turned about its origin, its image, a robot's beams."""

import io
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Polygon
from PIL import Image

from experiments.pictures.kept import draw_ground, figure, graph_paper, keep, plain
from pgm_places import LabelGraph, save_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import LABEL_COLOURS, UNKNOWN, WALL
from pgm_places.pictures.drawing import INK, MUTED
from pgm_places.sensing.ray_casting import cast_poses

BEAM = "#1f5fa8"
ROWS = ("???????", "?#####?", "?#...#?", "?#...##", "?#.....", "?######")
"""As an image shows it: the top row first."""
N_BEAMS = 12


def small_map() -> OccupancyGrid:
    """Six rows of seven cells, turned a little."""
    values = {"?": -1, "#": 100, ".": 0}
    cells = [[values[mark] for mark in row] for row in reversed(ROWS)]
    return OccupancyGrid(cells, 0.5, origin_xy_m=(1.0, 0.5), yaw_rad=np.deg2rad(12))


def conventions() -> None:
    """A map in its frame, the same map as an image, and a pose with its beams."""
    grid = small_map()
    picture = figure(11, 4.4)
    axes = picture.subplots(1, 3, width_ratios=(1.25, 1, 1))
    _in_the_map_frame(axes[0], grid)
    _as_an_image(axes[1], grid)
    _beams(axes[2])
    keep("conventions", picture)


def _shade(kind: int) -> str:
    return {0: "white", 100: WALL, -1: UNKNOWN}[kind]


def _in_the_map_frame(axis: Axes, grid: OccupancyGrid) -> None:
    """Cells with the numbers of their nodes, rows, columns, origin and yaw."""
    graph = LabelGraph.from_grid(grid)
    half = 0.5 * np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])
    for (row, column), kind in np.ndenumerate(grid.cells):
        corners = grid.cell_centres_m(half + np.array((row, column)))
        axis.add_patch(Polygon(corners, facecolor=_shade(kind), edgecolor="#b6bbc2", lw=0.8))
    assert graph.positions_m is not None
    for node, (x, y) in enumerate(graph.positions_m):
        axis.text(x, y, str(node), ha="center", va="center", fontsize=10, color=INK)
    height, width = grid.shape
    turn = np.rad2deg(grid.yaw_rad)
    _along(axis, grid, [(row, width - 0.1) for row in range(height)], "row", turn)
    _along(axis, grid, [(height - 0.1, column) for column in range(width)], "column", turn + 90)
    x, y = grid.origin_xy_m
    axis.plot([x, x + 2.6], [y, y], color=BEAM, lw=1.2, ls=":")
    axis.plot(x, y, "o", color=BEAM, ms=7, zorder=3)
    axis.annotate(f"origin_xy_m = ({x:g}, {y:g})", (x, y), (0.1, -0.2), fontsize=9, color=BEAM)
    axis.add_patch(Arc((x, y), 4.4, 4.4, theta1=0, theta2=turn, color=BEAM, lw=1.2))
    axis.text(x + 2.65, y, f"yaw_rad = {grid.yaw_rad:.2f}", fontsize=9, color=BEAM, va="center")
    graph_paper(axis, "in the map frame: numbers of nodes")
    axis.grid(visible=False)
    axis.set_aspect("equal")
    axis.set_xlim(0, 5.4)
    axis.set_ylim(-0.4, 4.7)
    axis.set_xlabel("x, m")
    axis.set_ylabel("y, m")


def _along(axis: Axes, grid: OccupancyGrid, places: list[Any], name: str, turn: float) -> None:
    """Numbers of rows or columns outside the grid."""
    for number, (x, y) in enumerate(grid.cell_centres_m(places)):
        words = f"{name} 0" if number == 0 else str(number)
        axis.text(x, y, words, fontsize=8.5, color=MUTED, rotation=turn, rotation_mode="anchor",
                  ha="left", va="center")  # fmt: skip


def _as_an_image(axis: Axes, grid: OccupancyGrid) -> None:
    """The pixels of the file that save_map writes, top row first."""
    with TemporaryDirectory() as folder:
        save_map(grid, Path(folder) / "map")
        [path] = [path for path in Path(folder).iterdir() if path.suffix != ".yaml"]
        pixels = np.asarray(Image.open(io.BytesIO(path.read_bytes())))
    axis.imshow(pixels, cmap="gray", vmin=0, vmax=255)
    height, width = pixels.shape
    for column in range(width + 1):
        axis.axvline(column - 0.5, color="#b6bbc2", lw=0.8)
    for row in range(height + 1):
        axis.axhline(row - 0.5, color="#b6bbc2", lw=0.8)
    axis.set_xticks(range(width))
    axis.set_yticks(range(height))
    axis.xaxis.tick_top()
    axis.tick_params(length=0, labelsize=9, colors=MUTED)
    axis.spines[:].set_visible(False)
    axis.set_title("its image file: rows from the top", loc="left", fontsize=10.5, color=INK)
    axis.set_xlabel("in TOML: rows = [1, 4], columns = [2, 5]", color=BEAM, fontsize=9)
    window = [(1.5, 0.5), (4.5, 0.5), (4.5, 3.5), (1.5, 3.5)]
    axis.add_patch(Polygon(window, facecolor="none", edgecolor=BEAM, lw=2.5))


def _beams(axis: Axes) -> None:
    """A pose in a room, its heading, and beams numbered counter-clockwise."""
    cells = np.full((60, 60), 100)
    cells[3:-3, 3:-3] = 0
    grid = OccupancyGrid(cells, 0.1)
    pose = (2.2, 2.0, np.deg2rad(30))
    angles = np.arange(N_BEAMS) * 2 * np.pi / N_BEAMS
    [ranges] = cast_poses(grid, [pose], angles, max_range_m=2.5)
    draw_ground(axis, grid)
    here = np.array(pose[:2])
    for number, (angle, range_m) in enumerate(zip(angles + pose[2], ranges, strict=True)):
        way = np.array([np.cos(angle), np.sin(angle)])
        missed = range_m >= 2.5
        axis.plot(*np.stack([here, here + range_m * way]).T, color=BEAM, lw=1.1,
                  ls=":" if missed else "-")  # fmt: skip
        x, y = here + (range_m - 0.28) * way
        axis.text(x, y, str(number), ha="center", va="center",
                  fontsize=9, color=INK,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.2})  # fmt: skip
    heading = here + 0.9 * np.array([np.cos(pose[2]), np.sin(pose[2])])
    arrow = {"arrowstyle": "-|>", "color": LABEL_COLOURS[2], "lw": 2.5}
    axis.annotate("", heading, here, arrowprops=arrow)
    axis.plot(*here, "o", color="white", markeredgecolor=INK, ms=9)
    plain(axis, "a pose and its beams: 0 straight ahead")
    axis.text(0, -0.03, "dotted: no return within 2.5 m, which reads 2.5", va="top", fontsize=9,
              color=BEAM, transform=axis.transAxes)  # fmt: skip
