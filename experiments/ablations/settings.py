"""Ablations: one factor varied at a time, all others at their defaults."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

from experiments.paper.figures import DOORWAY, method_findings, method_table, percent
from experiments.paper.section import Finding, Outcome, Table
from experiments.paper.setting import Setting
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare, compare_fitted
from pgm_places.experiment.setup import make_labeler
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.tasks import learned, task_of
from pgm_places.features.laser import LASER_FEATURES
from pgm_places.kernels.threads import threads
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import reported
from pgm_places.unary.list_learning import with_explicit_order
from pgm_places.unary.training_cells import training_features

CONFIG = "ablations"
TAUGHT = (
    "Building 79, left half to right half, 5 cm; lists trained on 10,000 cells drawn at random, so "
    "figures are slightly below those of section 7.5."
)
N_SELECTED = 30
N_BEAMS = (90, 180, 360, 720)
CELLS_M = (0.05, 0.1, 0.2, 0.4)
SEEDS = (0, 1, 2)
PAPER_NOISE = {"sigma_m": 0.05, "p_random": 0.01, "p_max": 0.01}
NOISES: Mapping[str, Mapping[str, float]] = {
    "2 cm": {"sigma_m": 0.02},
    "5 cm": {"sigma_m": 0.05},
    "10 cm": {"sigma_m": 0.1},
    "5 cm, 1 % random, 1 % maximum": PAPER_NOISE,
    "5 cm, 5 % random, 5 % maximum": {"sigma_m": 0.05, "p_random": 0.05, "p_max": 0.05},
    "20 % maximum": {"p_max": 0.2},
}
FIRST_COLUMNS = (330, 290, 240, 170, 90, 0)


def beams(setting: Setting) -> Outcome:
    """The number of simulated beams."""
    found = {
        f"{number} beams": _compare(setting, {"sensor.n_beams": number}, ("adaboost", "relaxation"))
        for number in N_BEAMS
    }
    return _outcome(
        f"{TAUGHT} Features are always computed on 360 beams: others are resampled to these.",
        "Beams over the full circle",
        found,
    )


def resolution(setting: Setting) -> Outcome:
    """The size of the cells, down to the finest that the map has."""
    found = {
        f"{100 * cells_m:g} cm": _compare(
            setting, {"resolution_m": cells_m}, ("adaboost", "relaxation")
        )
        for cells_m in CELLS_M
    }
    return _outcome(TAUGHT, "Cell size", found)


def noise(setting: Setting) -> Outcome:
    """Noisy beams in training and labelling, as in the paper's simulator, for several seeds."""
    methods = ("adaboost", "relaxation", "amn")
    clean = _compare(setting, {}, methods)
    noisy = {
        name: [
            _compare(setting, {"sensor.noise": {**values, "seed": seed}}, methods[: _n(name)])
            for seed in SEEDS
        ]
        for name, values in NOISES.items()
    }
    rows = [_spread_row("none", method.id, [method.evaluation]) for method in clean.methods]
    for name, runs in noisy.items():
        for k, method in enumerate(runs[0].methods):
            rows.append(_spread_row(name, method.id, [run.methods[k].evaluation for run in runs]))
    heading = ("noise", "method", "accuracy", "balanced", "doorway recall", "doorway F1")
    caption = f"Beam noise; mean ± standard deviation over {len(SEEDS)} seeds"
    by_paper = noisy["5 cm, 1 % random, 1 % maximum"]
    findings = [*method_findings({"no noise": clean})]
    for k, method in enumerate(by_paper[0].methods):
        figures = _means([run.methods[k].evaluation for run in by_paper])
        findings.append(Finding(f"5 cm, 1 % random, 1 % maximum, {method.id}", *figures))
    return Outcome(TAUGHT, tuple(findings), (Table(caption, heading, tuple(rows)),))


def training_size(setting: Setting) -> Outcome:
    """The labelled area: stripes of the left half that grow from the cut towards the left."""
    found = {}
    for first in FIRST_COLUMNS:
        experiment = setting.experiment(CONFIG)
        [train] = load_maps(experiment, "train")
        part = stripe(train, first / FIRST_COLUMNS[0])
        area = part.labelled_cells.sum() * part.grid.resolution_m**2
        if len(np.unique(part.labels[part.labelled_cells])) < len(experiment.config.labels.names):
            continue  # a stripe without a doorway teaches nothing of doorways
        found[f"{area:.0f} m²"] = _compare_on(setting, part)
    return _outcome(TAUGHT, "Labelled area for training", found)


def features(setting: Setting) -> Outcome:
    """The features given to the list: beams, polygon, both, or those that boosting chose first."""
    experiment = setting.experiment(CONFIG)
    labeler = make_labeler(experiment.config)
    maps = [*load_maps(experiment, "train"), *load_maps(experiment, "test")]
    with threads(setting.n_threads), reported(setting.progress):
        parts = [training_features([item], labeler.sensor) for item in maps]
    truths = [item.labels[item.labelled_cells].astype(np.int64) for item in maps]
    some = _some_cells(len(truths[0]), experiment.config.classifier.max_examples_per_map)
    learner = with_explicit_order(labeler.classifier, truths[0])  # type: ignore[arg-type]
    group: NDArray[np.str_] = np.array([spec.group for spec in LASER_FEATURES])
    columns = {
        "beams": np.flatnonzero(group == "beams"),
        "polygon": np.flatnonzero(group == "polygon"),
        "both": np.arange(len(group)),
    }
    whole = clone(learner).fit(parts[0][some], truths[0][some])
    chosen = np.asarray(whole.features_in_order_of_choice(N_SELECTED), np.int64)
    columns[f"the first {len(chosen)} chosen by boosting"] = np.sort(chosen)
    names = tuple(experiment.config.labels.names)
    rows, findings = [], []
    for name, kept in columns.items():
        fitted = clone(learner).fit(parts[0][some][:, kept], truths[0][some])
        log_z = fitted.boosted_list_.log_histogram(np.ascontiguousarray(parts[1][:, kept]))
        scored = evaluate(truths[1], log_z.argmax(axis=1), names)
        rows.append((name, f"{len(kept)}", *_figures(scored)))
        figures = (scored.accuracy, scored.balanced_accuracy, scored.f1[DOORWAY])
        findings.append(Finding(name, *figures))
    heading = ("features", "columns", "accuracy", "balanced", "doorway recall", "doorway F1")
    table = Table("The decision list alone on subsets of the features", heading, tuple(rows))
    return Outcome(TAUGHT, tuple(findings), (table,))


def stripe(train: LabelledMap, share: float) -> LabelledMap:
    """The labelled map without this share of its labelled columns, counted from the left."""
    at = np.flatnonzero(train.labelled_cells.any(axis=0))
    window = np.zeros(train.grid.shape, np.bool_)
    first = int(at[0] + share * 0.9 * (at[-1] - at[0]))
    window[:, first:] = True
    if train.window is not None:
        window &= train.window
    return LabelledMap(train.grid, train.labels, window, train.name, train.building)


def _some_cells(n_cells: int, most: int | None) -> NDArray[np.bool_]:
    """The cells to train on, as PlaceLabeler draws them."""
    if most is None or n_cells <= most:
        return np.ones(n_cells, np.bool_)
    return np.random.default_rng(0).permutation(n_cells) < most


def _n(name: str) -> int:
    """How many methods run at a noise level: the slow network only at the paper's."""
    return 3 if name == "5 cm, 1 % random, 1 % maximum" else 2


def _compare(setting: Setting, changes: Mapping[str, Any], methods: Sequence[str]) -> Comparison:
    experiment = setting.experiment(CONFIG, changes)
    kept = tuple(item for item in experiment.config.methods if item.id in methods)
    experiment = replace(experiment, config=replace(experiment.config, methods=kept))
    return compare(experiment)


def _compare_on(setting: Setting, train: LabelledMap) -> Comparison:
    experiment = setting.experiment(CONFIG)
    kept = tuple(item for item in experiment.config.methods if item.id != "amn")
    experiment = replace(experiment, config=replace(experiment.config, methods=kept))
    trained = learned(task_of(experiment.config), experiment, Sources([train]))
    return compare_fitted(trained, load_maps(experiment, "test"))


def _outcome(words: str, caption: str, found: dict[str, Comparison]) -> Outcome:
    return Outcome(words, method_findings(found), (method_table(caption, found),))


def _figures(scored: Evaluation) -> tuple[str, ...]:
    values = (
        scored.accuracy,
        scored.balanced_accuracy,
        scored.recall[DOORWAY],
        scored.f1[DOORWAY],
    )
    return tuple(percent(value) for value in values)


def _means(scored: Sequence[Evaluation]) -> tuple[float, float, float]:
    rows = [(item.accuracy, item.balanced_accuracy, item.f1[DOORWAY] or 0.0) for item in scored]
    accuracy, balanced, doorways = np.mean(rows, axis=0).tolist()
    return accuracy, balanced, doorways


def _spread_row(name: str, method: str, scored: Sequence[Evaluation]) -> tuple[str, ...]:
    columns = [
        [item.accuracy for item in scored],
        [item.balanced_accuracy for item in scored],
        [item.recall[DOORWAY] or 0.0 for item in scored],
        [item.f1[DOORWAY] or 0.0 for item in scored],
    ]
    return (name, method, *(_mean_and_spread(values) for values in columns))


def _mean_and_spread(values: Sequence[float]) -> str:
    mean = percent(float(np.mean(values)))
    return mean if len(values) < 2 else f"{mean} ± {percent(float(np.std(values, ddof=1)))}"
