"""Pictures of what is learned: the demo's building, boosting round by round, counted objects."""

from functools import cache
from typing import Any

import networkx as nx
import numpy as np
from matplotlib.patches import Circle, Wedge
from numpy.typing import NDArray

from experiments.paper.furnished_floors import make_floor
from experiments.paper.placement import place_objects
from experiments.pictures.kept import (
    COLOURS,
    NAMES,
    draw_labels,
    figure,
    graph_paper,
    keep,
    legend,
    plain,
)
from pgm_places import LabelGraph, LabelingProblem, LabelledMap, PlaceLabeler, Sensor, build
from pgm_places.datasets import generate_building
from pgm_places.features.extraction import extract
from pgm_places.features.laser import laser_feature_names
from pgm_places.labelers.method import PlaceMethod
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.pictures.drawing import INK
from pgm_places.sensing.ray_casting import cast_cells

ROUNDS = (1, 2, 5, 10, 20, 50, 100, 200)


def overview() -> None:
    """The demo: learned on one half of a building, its other half labelled by three methods."""
    made = generate_building(0, resolution_m=0.1)
    left, labels = made.labels.copy(), made.labels.copy()
    left[:, made.split_column :] = -1
    labels[:, : made.split_column] = -1
    methods = {
        "AdaBoost alone": PlaceMethod("independent", "laser"),
        "relaxation": PlaceMethod("relaxation", "context"),
        "associative Markov network": PlaceMethod("amn", "context"),
    }
    labeler = PlaceLabeler(NAMES, methods, space=None, context_m=(0.3, 0.75, 1.5, 3.0))
    labeler.fit([LabelledMap(made.grid, left)])
    graph, scores = labeler.scores(made.grid)
    seen = np.arange(made.grid.shape[1]) < made.split_column
    half = made.grid.with_cells(np.where(seen, -1, made.grid.cells))
    picture = figure(10, 8.2)
    axes = picture.subplots(2, 2)
    draw_labels(axes[0, 0], half, labels, "ground truth")
    for axis, name in zip(axes.flat[1:], methods, strict=True):
        raster = graph.layout.to_raster(labeler.infer(graph, scores, method=name).labels, fill=-1)
        known = (labels >= 0) & (raster >= 0)
        rate = 100 * np.mean(raster[known] == labels[known])
        draw_labels(axis, half, np.where(seen, -1, raster), f"{name}: {rate:.1f} % right")
    legend(picture)
    keep("overview", picture)


@cache
def _cells() -> tuple[NDArray[Any], ...]:
    """Features and labels of the cells of three small buildings, and of a fourth."""
    parts = []
    for seed in (0, 3, 4, 2):
        made = generate_building(seed, size="small", resolution_m=0.1)
        known = LabelledMap(made.grid, made.labels)
        truth = known.truth(known.graph())
        sensor = Sensor()
        values = extract(cast_cells(made.grid, sensor), max_range_m=sensor.max_range_m)
        parts.append((values[truth >= 0], truth[truth >= 0]))
    (x1, x2, x3, test), (y1, y2, y3, truth) = zip(*parts, strict=True)
    return np.concatenate([x1, x2, x3]), np.concatenate([y1, y2, y3]), test, truth


def boosting() -> None:
    """The first stump for doorways, and errors on a new building round by round."""
    learn, labels, test, truth = _cells()
    picture = figure(10, 3.7)
    axes = picture.subplots(1, 2)
    list_ = DecisionListClassifier(1, order=[2, 0, 1]).fit(learn, labels)
    stump = list_.list_[0]
    column = int(np.asarray(stump.feature)[0])
    threshold = float(np.asarray(stump.threshold)[0])
    edges = np.linspace(*np.quantile(learn[:, column], [0.002, 0.995]), 60)
    others = np.isin(labels, [0, 1])
    for chosen, colour, name in (
        (others, "#9aa3ad", "corridor and room"),
        (~others, COLOURS[2], "doorway"),
    ):
        axes[0].hist(learn[chosen, column], edges, density=True, color=colour, alpha=0.65,
                     label=name)  # fmt: skip
    axes[0].axvline(threshold, color=INK, lw=1.5, ls="--")
    name = laser_feature_names()[column]
    axes[0].set_xlabel(f"feature {name}; the dashed line is the threshold")
    axes[0].set_yticks([])
    axes[0].legend(frameon=False, fontsize=9.5)
    graph_paper(axes[0], "the first stump: doorway or not?")
    for depth, shrinkage, title, colour in (
        (1, 1.0, "stumps", "#2b4bb8"),
        (3, 0.3, "trees", COLOURS[2]),
    ):
        errors = []
        for n in ROUNDS:
            options = {"max_depth": depth, "shrinkage": shrinkage, "decision": "argmax"}
            made = DecisionListClassifier(n, order=[2, 0, 1], prior_weight=0.5, **options)
            errors.append(100 * np.mean(made.fit(learn, labels).predict(test) != truth))
        print(title, np.round(errors, 1))
        axes[1].plot(ROUNDS, errors, "o-", color=colour, lw=1.8, ms=4, label=title)
    axes[1].set_xscale("log")
    axes[1].set_xticks(ROUNDS, map(str, ROUNDS))
    axes[1].minorticks_off()
    axes[1].set_ylim(0)
    axes[1].set_xlabel("rounds")
    axes[1].set_ylabel("wrong cells, %")
    axes[1].legend(frameon=False, fontsize=9.5)
    graph_paper(axes[1], "errors on a building not trained on")
    keep("boosting", picture)


def vision() -> None:
    """Objects on a floor, and what a ring of cameras sees of them from one place."""
    made = make_floor(11)
    grid, reach = made.grid, 5.0
    objects = place_objects(grid, made.labels, made.names, made.furnishing, seed=11)
    picture = figure(10, 4.6)
    axis = picture.subplots()
    draw_labels(axis, grid, np.full(grid.shape, -1))
    marks = ("o", "s", "^", "D", "v", "P", "X", "*")
    shades = (
        "#2b4bb8",
        "#a6336c",
        "#154816",
        "#b5482a",
        "#6d6108",
        "#700967",
        "#0f766e",
        "#2d2d2d",
    )
    for kind, name in enumerate(objects.object_names):
        at = objects.positions_m[objects.kinds == kind]
        if len(at):
            axis.scatter(*at.T, s=26, marker=marks[kind], color=shades[kind], label=name, zorder=3)
    steps = made.drive.poses
    here = steps[len(steps) // 3]
    for image in range(8):
        middle = np.degrees(here[2]) + 45 * image
        axis.add_patch(Wedge(here[:2], reach, middle - 22.5, middle + 22.5, facecolor="#f4c150",
                             alpha=0.28, edgecolor="#8d96a3"))  # fmt: skip
    axis.add_patch(Circle(here[:2], 0.3, facecolor="white", edgecolor=INK, zorder=4))
    plain(axis)
    picture.legend(loc="outside lower left", ncols=4, frameon=False, fontsize=9.5)
    keep("vision", picture)


def own_problem() -> None:
    """A club that broke apart: two known members, and the side that the graph gives all others."""
    club = nx.karate_club_graph()
    graph = LabelGraph.from_networkx(club)
    ties = graph.edge_values(nx.get_edge_attributes(club, "weight"))
    known = np.full(graph.n_nodes, -1)
    known[0], known[33] = 0, 1
    problem = LabelingProblem(
        graph, ("instructor", "officer"), edge_features=ties[:, None], known=known
    )
    labels = build("potts", {"edge_weights": "given"}).infer(problem).labels
    side = graph.node_values(nx.get_node_attributes(club, "club")) == "Officer"
    at = nx.spring_layout(club, seed=3, weight=None)
    picture = figure(8, 4.4)
    axis = picture.subplots()
    shades = np.array([COLOURS[0], COLOURS[1]])
    nx.draw_networkx_edges(club, at, ax=axis, width=0.35 * ties, edge_color="#9aa3ad")
    rim = np.where(labels == side, "white", "#d1002c")
    size = np.where(known >= 0, 620, 260)
    nx.draw_networkx_nodes(club, at, ax=axis, node_color=list(shades[labels]), node_size=size,
                           edgecolors=list(rim), linewidths=2)  # fmt: skip
    nx.draw_networkx_labels(club, at, ax=axis, font_size=8, font_color=INK)
    axis.set_axis_off()
    legend(picture, ("with the instructor (0)", "with the officer (33)"), list(shades))
    print(f"{(labels == side).mean():.3f}")
    keep("own_problem", picture)
