"""Pictures of the methods for sequences: drives of a simulated robot through small buildings."""

from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from experiments.defaults import Labelled, scored
from experiments.pictures.kept import COLOURS, NAMES, figure, floor, graph_paper, keep, legend
from pgm_places import LabelGraph, LabelingProblem, LabelledMap, ScanGeometry, trained_tracker
from pgm_places.datasets import generate_building
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.models.semi_markov import SemiMarkovModel
from pgm_places.palette import ERROR
from pgm_places.pictures.drawing import INK, MUTED
from pgm_places.sensing.simulated_robot import SimulatedRobot

N_LEARNED = 10


def drive(seed: int) -> Labelled:
    """A drive of 60 m with a scan every 0.4 m; features are quantiles of the ranges."""
    building = generate_building(seed, size="small")
    path = SimulatedRobot(scan_every_s=1.0).explore(building.grid, max_length_m=60.0, seed=seed)
    path = path.labelled_by(LabelledMap(building.grid, building.labels), NAMES)
    ranges = np.sort(np.minimum(path.ranges_m, 10.0), axis=1)
    looks = np.log(np.maximum(ranges[:, ::12], 0.05))
    graph = LabelGraph.from_trajectory(path.poses[:, :2])
    return LabelingProblem(graph, NAMES, node_features=looks), path.labels.astype(np.int64)


@cache
def drives() -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """Drives to learn from, with their labels."""
    examples = [drive(seed) for seed in range(N_LEARNED)]
    train, _ = scored(examples, N_LEARNED, make_pipeline(StandardScaler(), LogisticRegression()))
    return train, [truth for _, truth in examples]


def on_a_floor(seed: int, length_m: float) -> Labelled:
    """A drive on a floor, its steps scored one by one by the shipped model of drives."""
    made, tracker = floor(seed), trained_tracker()
    path = SimulatedRobot(ScanGeometry.full_circle(360), scan_every_s=0.8).explore(
        made.grid, max_length_m=length_m, seed=seed
    )
    path = path.labelled_by(LabelledMap(made.grid, made.labels), NAMES)
    graph = LabelGraph.from_trajectory(path.poses[:, :2])
    names = list(tracker.label_names_)
    unary = tracker.scores(path)[:, [names.index(name) for name in NAMES]]
    return LabelingProblem(graph, NAMES, unary), path.labels.astype(np.int64)


def hmm() -> None:
    """A drive labelled scan by scan, and in the three modes."""
    learned = [on_a_floor(seed, 80.0) for seed in (71, 72, 73)]
    test, truth = on_a_floor(64, 70.0)
    model = HiddenMarkovModel(evidence_weight="fitted")
    model = model.fit([problem for problem, _ in learned], [labels for _, labels in learned])
    rows = {"the truth": truth, "each scan alone": test.unary.argmax(axis=1)}
    for mode, title in (
        ("filter", "filter: the past alone"),
        ("smooth", "smoother: past and future"),
        ("viterbi", "most probable path"),
    ):
        rows[title] = replace(model, mode=mode).infer(test).labels
    steps = np.linalg.norm(np.diff(test.graph.positions_m, axis=0), axis=1)
    edges = np.cumsum(np.concatenate([[0], steps, [steps.mean()]]))
    middle = (edges[:-1] + edges[1:]) / 2
    picture = figure(10, 5.4)
    axes = picture.subplots(len(rows), 1, sharex=True)
    for axis, (title, labels) in zip(axes, rows.items(), strict=True):
        colours = ListedColormap(COLOURS)
        axis.pcolormesh(edges, [0, 1], labels[None, :], cmap=colours, vmin=0, vmax=2)
        known = truth >= 0
        wrong = known & (labels != truth)
        axis.plot(middle[wrong], np.full(wrong.sum(), -0.16), "^", ms=4, color=ERROR)
        rate = "" if labels is truth else f": {100 * np.mean(~wrong[known]):.1f} % right"
        axis.set_title(title + rate, loc="left", fontsize=10.5, color=INK)
        axis.set_ylim(-0.3, 1)
        axis.set_yticks([])
        axis.spines[:].set_visible(False)
        axis.tick_params(colors=MUTED, labelsize=9, length=0)
    axes[-1].set_xlabel("metres along the drive", color=MUTED)
    legend(picture)
    keep("hmm", picture)


def semi_markov() -> None:
    """How long places last: learned rates against constant ones."""
    train, truths = drives()
    model = SemiMarkovModel().fit(train, truths)
    metres = np.linspace(0, 8, 400)
    starts, rates = np.asarray(model.edges_m), np.asarray(model.rates)
    picture = figure(9, 3.7)
    axis = picture.subplots()
    for name, colour, rate in zip(NAMES, COLOURS, rates, strict=True):
        at = np.searchsorted(starts, metres, side="right") - 1
        step = metres[1] - metres[0]
        lasts = np.exp(-np.append(0, np.cumsum(rate[at[:-1]] * step)))
        mean = np.sum(lasts) * step + lasts[-1] / rate[-1]  # beyond 8 m the rate is constant
        axis.plot(metres, lasts, color=colour, lw=2.4, label=f"{name}, mean {mean:.1f} m")
        axis.plot(metres, np.exp(-metres / mean), color=colour, lw=1.4, ls="--")
    axis.set_xlim(0, 8)
    axis.set_ylim(0, 1.02)
    axis.set_xlabel("metres driven since the place was entered")
    axis.set_ylabel("probability to be there still")
    graph_paper(axis)
    axis.legend(frameon=False, fontsize=10)
    keep("semi_markov", picture)
