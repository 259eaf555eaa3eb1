"""Pictures of the methods: one floor, one weak classifier, and what each method makes of it.

The classifier is a list of few stumps on laser features, so that there is something to correct.
"""

from functools import cache
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm

from experiments.pictures.kept import (
    NAMES,
    at,
    crop,
    draw_ground,
    draw_labels,
    figure,
    graph_paper,
    keep,
    legend,
    plain,
    right,
)
from pgm_places import LabelGraph, LabelledMap, PlaceLabeler, Potentials, build, decode
from pgm_places.datasets import generate_building
from pgm_places.datasets.building import LabelledBuilding
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.palette import levels
from pgm_places.pictures.drawing import INK
from pgm_places.unary.map_model import CellScores

N_ROUNDS = 20
WEIGHTS = (0.0, 0.1, 0.25, 1.0, 4.0)
ITERATIONS = (1, 5, 20, 100)


@cache
def weak() -> tuple[PlaceLabeler, LabelledBuilding, LabelGraph, CellScores]:
    """A labeler of three small buildings, a fourth one, its graph and its scores."""
    made = [generate_building(seed, size="small", resolution_m=0.1) for seed in (0, 3, 4, 2)]
    methods: dict[str, Any] = {
        "independent": build("independent"),
        "relaxation": build("relaxation"),
        "amn": build("amn", {"class_weight": "cube-root"}),
    }
    methods |= {f"potts {weight:g}": build("potts", {"weight": weight}) for weight in WEIGHTS}
    methods |= {f"relax {n}": build("relaxation", {"max_iterations": n}) for n in ITERATIONS}
    list_ = DecisionListClassifier(N_ROUNDS, order="rarest-first")
    labeler = PlaceLabeler(NAMES, methods, classifier=list_, space=None)
    labeler.fit([LabelledMap(item.grid, item.labels) for item in made[:-1]])
    graph, scores = labeler.scores(made[-1].grid)
    return labeler, made[-1], graph, scores


def _labels(method: str) -> Any:
    labeler, _, graph, scores = weak()
    return graph.layout.to_raster(labeler.infer(graph, scores, method=method).labels, fill=-1)


def _share(method: str) -> str:
    return f"{100 * right(weak()[1], _labels(method)):.1f} % right"


def independent() -> None:
    """The probabilities of the labels, and the largest of them."""
    labeler, made, graph, scores = weak()
    beliefs = labeler.infer(graph, scores, method="independent").beliefs
    picture = figure(10, 5.2)
    axes = picture.subplots(2, 2)
    gradient = LinearSegmentedColormap.from_list("probability", levels("probability", 24))
    for axis, name, belief in zip(axes.flat, NAMES, beliefs.T, strict=False):
        draw_ground(axis, made.grid)
        raster = np.ma.masked_invalid(graph.layout.to_raster(belief, fill=np.nan))
        drawn = axis.imshow(raster, cmap=gradient, vmin=0, vmax=1, **at(made.grid))
        crop(axis, made.grid)
        plain(axis, f"probability of {name}")
    picture.colorbar(drawn, ax=axes, fraction=0.02, pad=0.02, label="probability")
    title = f"the most probable label: {_share('independent')}"
    draw_labels(axes[1, 1], made.grid, _labels("independent"), title)
    legend(picture)
    keep("independent", picture)


def _beside_the_truth(
    name: str, titles: dict[str, str], shape: tuple[int, int], height: float
) -> None:
    """Keep the picture of a floor's true labels and those of some methods."""
    made = weak()[1]
    picture = figure(10, height)
    first, *others = picture.subplots(*shape).flat
    draw_labels(first, made.grid, made.labels, "the truth")
    for axis, (method, title) in zip(others, titles.items(), strict=True):
        draw_labels(axis, made.grid, _labels(method), f"{title}: {_share(method)}")
    legend(picture)
    keep(name, picture)


def potts() -> None:
    """From no weight to far too much."""
    titles = {f"potts {weight:g}": f"weight {weight:g}" for weight in WEIGHTS}
    _beside_the_truth("potts", titles, (2, 3), 5.2)


def relaxation() -> None:
    """A floor after some iterations, and the learned coefficients."""
    labeler, made, *_ = weak()
    picture = figure(10, 5.6)
    axes = picture.subplots(2, 3)
    draw_labels(axes[0, 0], made.grid, _labels("independent"), f"start: {_share('independent')}")
    places = (axes[0, 1], axes[0, 2], axes[1, 0], axes[1, 1])
    for axis, n in zip(places, ITERATIONS, strict=True):
        method = f"relax {n}"
        title = f"{n} iteration{'s' * (n > 1)}: {_share(method)}"
        draw_labels(axis, made.grid, _labels(method), title)
    method_ = labeler.method("relaxation").backend
    table = np.asarray(method_.compatibility)[0]
    names = (*NAMES, "wall")[: len(table)]
    axis = axes[1, 2]
    colours = LinearSegmentedColormap.from_list("signed", ["#b5482a", "white", "#2b4bb8"])
    axis.imshow(table, cmap=colours, norm=TwoSlopeNorm(0, -1, 1))
    for (row, column), value in np.ndenumerate(table):
        shade = "white" if abs(value) > 0.6 else INK
        text = f"{value:.2f}".replace("-", "\N{MINUS SIGN}")
        axis.text(column, row, text, ha="center", va="center", fontsize=9, color=shade)
    axis.set_xticks(range(len(names)), names, fontsize=8.5, rotation=20)
    axis.set_yticks(range(len(names)), names, fontsize=8.5)
    axis.tick_params(length=0, colors=INK)
    axis.spines[:].set_visible(False)
    axis.set_title("learned compatibility", fontsize=10.5, color=INK, loc="left")
    legend(picture)
    keep("relaxation", picture)


def amn() -> None:
    """Cell by cell, one weight for all labels, and learned weights."""
    titles = {"independent": "cell by cell", "potts 0.25": "one weight, 0.25", "amn": "learned"}
    _beside_the_truth("amn", titles, (2, 2), 5.4)


def decoders() -> None:
    """The score of the best labelling and the bound, pass by pass, on a hard problem."""
    side, n_labels = 50, 6
    rng = np.random.default_rng(2)
    graph = LabelGraph.from_lattice((side, side))
    unary = rng.normal(size=(side * side, n_labels))
    tables = rng.normal(scale=0.45, size=(graph.n_edges, n_labels, n_labels))
    potentials = Potentials(unary, pairwise=tables)
    passes = np.unique(np.round(np.geomspace(1, 200, 14)).astype(int))
    runs = [decode(graph, potentials, "trw-s", max_iterations=int(n)) for n in passes]
    scores, bounds = ([getattr(run, key) for run in runs] for key in ("score", "bound"))
    best = max(scores)
    picture = figure(9, 3.9)
    axis = picture.subplots()
    axis.fill_between(passes, scores, bounds, color="#2b4bb8", alpha=0.10, lw=0)
    axis.plot(passes, bounds, color="#2b4bb8", lw=1.8, ls="--")
    axis.plot(passes, scores, color="#2b4bb8", lw=2.2)
    right_end = passes[-1] * 1.06
    axis.annotate("trw-s: no labelling is above", (right_end, bounds[-1]), va="bottom",
                  fontsize=9.5, color="#2b4bb8", annotation_clip=False)  # fmt: skip
    axis.annotate("trw-s: its labelling", (right_end, scores[-1]), va="center",
                  fontsize=9.5, color="#2b4bb8", annotation_clip=False)  # fmt: skip
    for name, colour in {"icm": "#b5482a", "mean-field": "#6d6108"}.items():
        score = decode(graph, potentials, name).score
        axis.axhline(score, color=colour, lw=1.4)
        axis.annotate(name, (right_end, score), va="center", fontsize=9.5, color=colour,
                      annotation_clip=False)  # fmt: skip
        print(name, score)
    axis.set_xscale("log")
    axis.set_xlim(1, passes[-1])
    axis.set_xticks([1, 10, 100], ["1", "10", "100"])
    axis.set_xlabel("passes of trw-s over the graph")
    axis.set_ylabel("score")
    graph_paper(axis, f"a grid of {side} x {side} nodes with {n_labels} labels and random tables")
    print(f"gap {bounds[-1] - best:.1f} of {best:.1f}", scores[:3], bounds[:3])
    layout: Any = picture.get_layout_engine()
    layout.set(rect=(0, 0, 0.83, 1))
    keep("inference", picture)
