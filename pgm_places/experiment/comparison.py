"""The results of several methods on the same data, and merging over splits or seeds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pgm_places import plotting
from pgm_places.evaluation import evaluation as metrics
from pgm_places.evaluation.bootstrap import Interval, pooled
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.evaluated_items import TestItem
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.significance import Significance, judge, resampled_counts
from pgm_places.inference.labeling import Labeling
from pgm_places.plotting import Plotted, axes_or_new, data_frame
from pgm_places.spaces.doorways import DoorScores

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_FIGURES = {"accuracy": "accuracy", "balanced_accuracy": "balanced accuracy"}


@dataclass(frozen=True, eq=False)
class SeedResult:
    """The results of a method with one seed: a labelling per map, and their pooled evaluation."""

    labelings: tuple[Labeling, ...]
    evaluation: Evaluation


@dataclass(frozen=True, eq=False)
class MethodResult:
    """The results of one method: a labelling and an evaluation per map, and the pooled evaluation.

    ``intervals`` has 95 % confidence intervals of ``accuracy`` and ``balanced_accuracy``.
    ``histories`` has the values of each iteration per map, ``learning`` the values of the training,
    both by quantity. ``doors`` counts doors per map; it is empty without a label for doorways.
    ``learned_with`` is the id of another method with the same training, which was run once and
    timed there. ``choices`` are texts on the options that the backend chose on training data.

    For training with several seeds, ``by_seed`` has the results of each. Evaluations and intervals
    are then over all seeds, seconds are means, and all other values are of the first seed.
    """

    id: str
    name: str
    options: Mapping[str, Any]
    labelings: tuple[Labeling, ...]
    evaluations: tuple[Evaluation, ...]
    evaluation: Evaluation
    seconds: Mapping[str, float]
    learned: Mapping[str, Any] = field(default_factory=dict)
    intervals: Mapping[str, Interval] = field(default_factory=dict)
    histories: tuple[Mapping[str, Sequence[float]], ...] = ()
    learning: Mapping[str, Sequence[float]] = field(default_factory=dict)
    doors: tuple[DoorScores, ...] = ()
    learned_with: str | None = None
    choices: Mapping[str, str] = field(default_factory=dict)
    by_seed: Mapping[int, SeedResult] = field(default_factory=dict)

    @property
    def all_labelings(self) -> list[tuple[Labeling, ...]]:
        """The labellings of all maps, for each seed."""
        return [result.labelings for result in self.by_seed.values()] or [self.labelings]

    def spread(self, figure: Callable[[Evaluation], float | None]) -> float | None:
        """The standard deviation of a figure over the seeds; None for one seed, or if undefined."""
        figures = [figure(result.evaluation) for result in self.by_seed.values()]
        values = [value for value in figures if value is not None]
        return float(np.std(values, ddof=1)) if len(values) > 1 else None


@dataclass(frozen=True, eq=False)
class Comparison(Plotted):
    """All results of a comparison, for the table, the pictures and the report.

    ``maps`` are the test items: maps, drives, graphs, or, for ``nodes = "both"``, each map followed
    by the drive through it. ``selection`` records the options tried on held-out training cells, and
    the chosen ones. ``choices`` are texts on options chosen on training data for all methods
    (``"unary": "context (held-out balanced accuracy 91.2; laser 88.0)"``), by the selection or by
    the labelers. ``splits`` has the range of items of each split by name; it is empty without
    splits. ``gates`` counts the doors per map that match accepted gates, if there are any.
    """

    title: str
    label_names: tuple[str, ...]
    maps: tuple[TestItem, ...]
    methods: tuple[MethodResult, ...]
    stage_seconds: Mapping[str, float]
    config: Mapping[str, Any]
    versions: Mapping[str, str]
    inputs: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    selection: Mapping[str, Any] | None = None
    choices: Mapping[str, str] = field(default_factory=dict)
    splits: Mapping[str, range] = field(default_factory=dict)
    gates: tuple[DoorScores, ...] = ()

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw accuracy and balanced accuracy of the methods with their 95 % intervals."""
        bars = {
            title: [100 * getattr(method.evaluation, figure) for method in self.methods]
            for figure, title in _FIGURES.items()
        }
        errors = {
            title: 100 * np.abs([self._ends(method, figure) for method in self.methods]).T
            for figure, title in _FIGURES.items()
        }
        ax = axes_or_new(ax)
        names = [method.id for method in self.methods]
        plotting.draw_bars(ax, names, bars, errors, "percent of the nodes")
        return ax

    def _ends(self, method: MethodResult, figure: str) -> tuple[float, float]:
        """The ends of a figure's interval relative to the figure; 0 without an interval."""
        interval = method.intervals.get(figure)
        value = getattr(method.evaluation, figure)
        return (0.0, 0.0) if interval is None else (interval.low - value, interval.high - value)

    def to_dataframe(self) -> Any:
        """The methods as a pandas table; InputError if pandas is not installed.

        Index ``method``; columns ``accuracy``, ``balanced_accuracy``, the ends of their 95 %
        intervals, ``recall`` of each label, from 0 to 1, and seconds by stage.
        """
        columns: dict[str, Any] = {"method": [method.id for method in self.methods]}
        for figure in _FIGURES:
            columns[figure] = [getattr(method.evaluation, figure) for method in self.methods]
            intervals = [method.intervals.get(figure) for method in self.methods]
            for end in ("low", "high"):
                columns[f"{figure}_{end}"] = [getattr(each, end, np.nan) for each in intervals]
        for name in self.label_names:
            recalls = [method.evaluation.recall[name] for method in self.methods]
            columns[f"recall_{name}"] = np.array(recalls, np.float64)
        for stage in dict.fromkeys(stage for method in self.methods for stage in method.seconds):
            columns[f"seconds_{stage}"] = [m.seconds.get(stage, np.nan) for m in self.methods]
        return data_frame(columns, "method")

    @cached_property
    def judgement(self) -> Significance:
        """Which differences between methods are significant."""
        labelings = {method.id: method.all_labelings for method in self.methods}
        return judge(self.maps, labelings, self.label_names)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds of training; () if only the configuration's seeds were used."""
        return tuple(self.methods[0].by_seed) if self.methods else ()

    @property
    def all_choices(self) -> dict[str, str]:
        """Texts on options chosen on training data: for all methods, then by each method."""
        of_methods = {
            f"{method.id}, {option}": words
            for method in self.methods
            for option, words in method.choices.items()
        }
        return {**self.choices, **of_methods}

    @property
    def n_evaluated(self) -> int:
        """Number of evaluated nodes: those with a true label."""
        return sum(int((item.node_truth >= 0).sum()) for item in self.maps)

    def by_split(self, method: MethodResult) -> dict[str, Evaluation]:
        """A method's evaluation on the test items of each split."""
        return {
            name: Evaluation.merged([method.evaluations[k] for k in items])
            for name, items in self.splits.items()
        }

    @property
    def unit(self) -> str:
        """The kind of nodes: ``cell``, ``step``, or ``node`` for both or for graphs."""
        units = {item.unit for item in self.maps}
        return units.pop() if len(units) == 1 else "node"

    @property
    def is_mixed(self) -> bool:
        """Whether there are several kinds of nodes."""
        return len({item.unit for item in self.maps}) > 1

    def by_unit(self, method: MethodResult) -> dict[str, Evaluation]:
        """A method's pooled evaluation of each kind of node: ``cell``, ``step``."""
        of_unit: dict[str, list[Evaluation]] = {}
        for item, evaluation in zip(self.maps, method.evaluations, strict=True):
            of_unit.setdefault(item.unit, []).append(evaluation)
        return {unit: Evaluation.merged(each) for unit, each in of_unit.items()}


def score_intervals(
    maps: Sequence[TestItem], labelings: Sequence[Sequence[Labeling]], n_labels: int
) -> dict[str, Interval]:
    """95 % confidence intervals of pooled ``accuracy`` and ``balanced_accuracy``.

    They are from a block bootstrap (:func:`pgm_places.evaluation.bootstrap.block_bootstrap`) over
    squares of ``BLOCK_M`` of maps, stretches of ``STRETCH_M`` of drives, and single nodes or
    ``NODES_PER_BLOCK`` adjacent nodes of graphs. ``labelings`` are per seed; seeds are resampled,
    too.
    """
    counts = pooled(resampled_counts(maps, n_labels)(labelings))
    return {
        "accuracy": Interval.of(metrics.accuracy(counts)),
        "balanced_accuracy": Interval.of(metrics.balanced_accuracy(counts)),
    }


_FIGURE = {"graph-cut": "score", "trw-s": "bound", "icm": "changed nodes"}
"""Quantities that decoders report per iteration; by default the largest change of a belief."""


def history_of(labeling: Labeling) -> dict[str, Sequence[float]]:
    """The values of each iteration of a labelling, by quantity."""
    history = labeling.info.get("history")
    if history is None:
        return {}
    if not isinstance(history, Mapping):
        decoder = str(labeling.info.get("decoder", ""))
        history = {_FIGURE.get(decoder, "change"): history}
        if "score_history" in labeling.info:
            history["score"] = labeling.info["score_history"]
    numbers = {str(quantity): _numbers(values) for quantity, values in history.items()}
    return {quantity: values for quantity, values in numbers.items() if values}


def learning_of(backend: object) -> dict[str, Sequence[float]]:
    """Objective and lower bound after each training step, if the method records them."""
    history = getattr(backend, "learning_history", None)
    if history is None or len(history) < 2:
        return {}
    return {"objective": history[:, 1].tolist(), "lower bound": history[:, 2].tolist()}


def _numbers(values: object) -> list[float]:
    """The values as floats, or nothing if they are not a sequence of numbers."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        return []
    return array.tolist() if array.ndim == 1 else []


def over_splits(experiment: Experiment, parts: Mapping[str, Comparison], words: str) -> Comparison:
    """Merge the comparisons of all splits by name, with the test items of all.

    ``experiment`` receives the warnings of all parts; ``words`` are appended to the title.
    """
    every = list(parts.values())
    first, maps = every[0], tuple(result for part in every for result in part.maps)
    ends = np.cumsum([0, *(len(part.maps) for part in every)]).tolist()
    methods = []
    for results in zip(*(part.methods for part in every), strict=True):
        merged = _concatenated(results)
        intervals = score_intervals(maps, [merged.labelings], len(first.label_names))
        choices = _choices(dict(zip(parts, [result.choices for result in results], strict=True)))
        methods.append(replace(merged, intervals=intervals, choices=choices))
    return replace(
        _noted(experiment, every),
        title=f"{first.title}: {words}",
        maps=maps,
        methods=tuple(methods),
        splits={name: range(*ends[k : k + 2]) for k, name in enumerate(parts)},
        selection=None,
        gates=tuple(scores for part in every for scores in part.gates),
        choices=_choices({name: part.choices for name, part in parts.items()}),
    )


def over_seeds(experiment: Experiment, parts: Mapping[int, Comparison]) -> Comparison:
    """Merge the comparisons of the same data with several seeds.

    Figures are over all seeds. Labellings, histories, doors and learned values are of the first
    seed; ``by_seed`` of each method has the labellings of all seeds.
    """
    every, methods = list(parts.values()), []
    first = every[0]
    for results in zip(*(part.methods for part in every), strict=True):
        pooled = _pooled(dict(zip(parts, results, strict=True)))
        labelings = [result.labelings for result in results]
        intervals = score_intervals(first.maps, labelings, len(first.label_names))
        choices = _choices(
            {f"seed {seed}": result.choices for seed, result in zip(parts, results, strict=True)}
        )
        methods.append(replace(pooled, intervals=intervals, choices=choices))
    if all(_is_independent_of_seed(method) for method in methods):
        experiment.warn(
            f"the labels of all methods are equal for all {len(parts)} seeds, because their "
            "training is not random; compare on several splits instead"
        )
    return replace(
        _noted(experiment, every),
        title=f"{first.title}, {len(parts)} seeds",
        methods=tuple(methods),
        selection=None,
        choices=_choices({f"seed {seed}": part.choices for seed, part in parts.items()}),
    )


def _choices(parts: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """The choices of all parts: once if they agree, else with the name of each part."""
    chosen: dict[str, str] = {}
    for option in dict.fromkeys(option for choices in parts.values() for option in choices):
        words = {name: choices[option] for name, choices in parts.items() if option in choices}
        if len(words) == len(parts) and len({*words.values()}) == 1:
            chosen[option] = next(iter(words.values()))
        else:
            chosen |= {f"{option} ({name})": text for name, text in words.items()}
    return chosen


def _noted(experiment: Experiment, parts: Sequence[Comparison]) -> Comparison:
    """The first part with the seconds, inputs and warnings of all."""
    seconds: dict[str, float] = {}
    inputs = dict(experiment.inputs)
    for part in parts:
        inputs |= part.inputs
        for name, value in part.stage_seconds.items():
            seconds[name] = seconds.get(name, 0.0) + value
        for message in part.warnings:
            experiment.warn(message)
    notes = tuple(experiment.warnings)
    return replace(parts[0], stage_seconds=seconds, inputs=inputs, warnings=notes)


def _concatenated(results: Sequence[MethodResult]) -> MethodResult:
    """The results of one method on all splits, without learned values, which differ."""
    return replace(
        results[0],
        labelings=tuple(item for result in results for item in result.labelings),
        evaluations=tuple(item for result in results for item in result.evaluations),
        evaluation=Evaluation.merged([result.evaluation for result in results]),
        seconds={key: sum(result.seconds[key] for result in results) for key in ("learn", "infer")},
        learned={},
        histories=tuple(item for result in results for item in result.histories),
        learning={},
        doors=tuple(item for result in results for item in result.doors),
    )


def _pooled(results: Mapping[int, MethodResult]) -> MethodResult:
    """The results of one method with all seeds; seconds are means over seeds."""
    every = list(results.values())
    by_map = zip(*(result.evaluations for result in every), strict=True)
    return replace(
        every[0],
        evaluations=tuple(Evaluation.merged(list(of_seeds)) for of_seeds in by_map),
        evaluation=Evaluation.merged([result.evaluation for result in every]),
        seconds={
            key: float(np.mean([result.seconds[key] for result in every]))
            for key in ("learn", "infer")
        },
        by_seed={
            seed: SeedResult(result.labelings, result.evaluation)
            for seed, result in results.items()
        },
    )


def _is_independent_of_seed(method: MethodResult) -> bool:
    first, *others = (result.labelings for result in method.by_seed.values())
    return all(
        np.array_equal(one.labels, two.labels)
        for other in others
        for one, two in zip(first, other, strict=True)
    )
