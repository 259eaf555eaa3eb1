"""Pictures of pages that explain: a configuration, extensions, faults and their remedies."""

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from sklearn.tree import DecisionTreeClassifier

from experiments.pictures.kept import (
    IMAGES,
    NAMES,
    at,
    crop,
    draw_ground,
    draw_labels,
    figure,
    keep,
    legend,
    plain,
    right,
)
from pgm_places import (
    LabelGraph,
    LabelingProblem,
    LabelledMap,
    PlaceLabeler,
    StructuredLabeler,
    build,
    label_map,
)
from pgm_places.datasets import generate_building
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.palette import LABEL_COLOURS, levels
from pgm_places.pictures.drawing import INK, MUTED
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.sensing.sensor import Sensor

PROBABILITY = LinearSegmentedColormap.from_list("probability", levels("probability", 24))

TOML = (
    """\
[labels]
names = ["corridor",
         "room",
         "doorway"]

[[train]]
generated = 1
half = "left"
""",
    """\
[sensor]
max_range_m = 15.0

[classifier]
n_rounds = 20
""",
    """\
[[methods]]
name = "independent"
unary = "laser"

[[methods]]
name = "potts"
unary = "laser"
""",
    """\
[[test]]
generated = 1
half = "right"
""",
)
"""One configuration in the four parts of the picture; it is run as it is shown."""
COARSE = "resolution_m = 0.2\n"


def configuration() -> None:
    """A configuration, and beside each of its parts what that part makes."""
    experiment = Experiment(parse_config(tomllib.loads(COARSE + "\n".join(TOML))), Path())
    [source] = load_maps(experiment, "train")
    known = np.where(source.window, source.labels, -1)
    found = compare(experiment)
    [tested] = found.maps
    alone, smoothed = found.methods
    picture = figure(10, 9.2)
    grid = picture.add_gridspec(4, 3, width_ratios=(1.0, 1.35, 1.35), height_ratios=(9, 7, 9, 5))
    for number, part in enumerate(TOML):
        _words(picture.add_subplot(grid[number, 0]), part, LABEL_COLOURS[(4, 3, 2, 10)[number]])
    wide = picture.add_subplot(grid[0, 1:])
    draw_labels(wide, source.grid, known, "what is known: the left half of a generated building")
    axes = [picture.add_subplot(grid[1, column]) for column in (1, 2)]
    for axis, label in zip(axes, (0, 2), strict=True):
        belief = np.asarray(alone.labelings[0].beliefs)[:, label]
        draw_ground(axis, tested.grid)
        raster = np.ma.masked_invalid(tested.layout.to_raster(belief, fill=np.nan))
        axis.imshow(raster, cmap=PROBABILITY, vmin=0, vmax=1, **at(tested.grid))
        _right_half(axis, tested)
        plain(axis, f"probability of {NAMES[label]}, cell by cell")
    for column, result in zip((1, 2), (alone, smoothed), strict=True):
        axis = picture.add_subplot(grid[2, column])
        labels = tested.layout.to_raster(result.labelings[0].labels, fill=-1)
        draw_labels(axis, tested.grid, labels, result.id)
        _right_half(axis, tested)
    _figures(picture.add_subplot(grid[3, 1:]), found)
    legend(picture)
    keep("configuration", picture)


def _words(axis: Axes, text: str, colour: str) -> None:
    """A part of the configuration beside a coloured bar."""
    plain(axis)
    axis.axvline(0, color=colour, lw=5)
    axis.set_xlim(0, 1)
    axis.text(0.05, 0.98, text, family="monospace", fontsize=9.5, color=INK, va="top",
              linespacing=1.35, transform=axis.transAxes)  # fmt: skip


def _right_half(axis: Axes, tested: Any) -> None:
    """Show the tested wing only."""
    crop(axis, tested.grid)
    first = np.flatnonzero(tested.window.any(axis=0))[0]
    axis.set_xlim(tested.grid.cell_centres_m([[0, first]])[0, 0], axis.get_xlim()[1])


def _figures(axis: Axes, found: Any) -> None:
    """The figures of the report as bars."""
    plain(axis, "what it is worth: cells of the right half that are right, with 95 % intervals")
    for row, result in enumerate(reversed(found.methods)):
        share = 100 * result.evaluation.accuracy
        interval = result.intervals["accuracy"]
        axis.barh(row, share, color="#c6dbef", height=0.62)
        axis.plot([100 * interval.low, 100 * interval.high], [row, row], color=INK, lw=1.5)
        axis.text(1, row, result.id, va="center", fontsize=10, color=INK)
        axis.text(101, row, f"{share:.1f} %", va="center", fontsize=10, color=INK)
    axis.set_xlim(0, 112)


def faq() -> None:
    """Three faults, and the same maps after they are mended."""
    known, made = (generate_building(seed, size="small", resolution_m=0.2) for seed in (0, 2))
    methods = {
        "alone": build("independent"),
        "potts": build("potts"),
        "long": build("relaxation", {"max_iterations": 100}),
        "short": build("relaxation", {"max_iterations": 5}),
    }
    list_ = DecisionListClassifier(20, order="rarest-first")
    labeler = PlaceLabeler(
        NAMES, methods, classifier=list_, context_m=(), space=None, learn_on="in-sample"
    ).fit([LabelledMap(known.grid, known.labels)])
    grid = made.grid
    wrong = grid.with_cells(np.where(grid.unknown, 0, grid.cells))

    def by(method: str, seen: OccupancyGrid = grid) -> Any:
        return label_map(labeler, seen, method=method).labels

    picture = figure(11, 5.0)
    axes = picture.subplots(2, 3)
    draw_labels(axes[0, 0], wrong, by("potts", wrong), "unknown read as free")
    crop(axes[0, 0], grid)
    draw_labels(axes[1, 0], grid, by("potts"), "--unknown-value 205")
    for axis, method, title in ((axes[0, 1], "alone", "specks"), (axes[1, 1], "potts", "potts")):
        labels = by(method)
        draw_labels(axis, grid, labels, f"{title}: {100 * right(made, labels):.1f} % right")
    for axis, method, n in ((axes[0, 2], "long", 100), (axes[1, 2], "short", 5)):
        labels = by(method)
        draw_labels(axis, grid, labels, f"{n} iterations: {_doorways(made, labels)}")
    for axis, name in zip(axes[:, 0], ("the fault", "mended"), strict=True):
        axis.text(-0.05, 0.5, name, rotation=90, ha="center", va="center", fontsize=11,
                  color=MUTED, transform=axis.transAxes)  # fmt: skip
    legend(picture)
    keep("faq", picture)


def _doorways(made: Any, labels: Any) -> str:
    """The share of the doorways' cells that are labelled so."""
    true = made.labels == NAMES.index("doorway")
    share = np.mean(labels[true] == NAMES.index("doorway"))
    return f"{100 * share:.0f} % of doorway cells"


def extending() -> None:
    """What the classes written on the page make of a map."""
    page = (IMAGES.parent / "extending.md").read_text(encoding="utf-8")
    own: dict[str, Any] = {"__name__": "extending"}
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        if "@dataclass" in code:
            exec(code, own)
    known, other = (generate_building(seed, size="small", resolution_m=0.1) for seed in (0, 2))
    features = {"Clearance": own["Clearance"](1), "OpenSpace": own["OpenSpace"](1.0)}

    def problem(grid: OccupancyGrid) -> LabelingProblem:
        graph = LabelGraph.from_grid(grid)
        columns = (
            features["Clearance"].of_scans(cast_cells(grid, Sensor()), 30.0),
            features["OpenSpace"].of_cells(grid, np.argwhere(grid.free)),
        )
        return LabelingProblem(graph, NAMES, node_features=np.concatenate(columns, axis=1))

    learned, asked = problem(known.grid), problem(other.grid)
    labeler = StructuredLabeler(own["MajorityVote"](), DecisionTreeClassifier(max_depth=6))
    labeler.fit([learned], [known.labels[known.grid.free].astype(int)])
    picture = figure(11, 2.9)
    axes = picture.subplots(1, 3)
    for axis, name, values in zip(axes, features, asked.node_features.T, strict=False):
        raster = np.full(other.grid.shape, np.nan)
        raster[other.grid.free] = values
        draw_ground(axis, other.grid)
        axis.imshow(np.ma.masked_invalid(raster), cmap="viridis", **at(other.grid))
        crop(axis, other.grid)
        plain(axis, f"a feature: {name}")
    labels = np.full(other.grid.shape, -1)
    labels[other.grid.free] = labeler.label(asked).labels
    draw_labels(axes[2], other.grid, labels, "a method: MajorityVote, on these two features alone")
    legend(picture)
    print(f"{100 * right(other, labels):.1f} % right")
    keep("extending", picture)
