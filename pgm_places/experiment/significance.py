"""Significance of differences between methods on the same nodes and buildings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation import evaluation as metrics
from pgm_places.evaluation.bootstrap import Interval, Resamples, SignTest, pooled
from pgm_places.experiment.evaluated_items import TestItem, blocks_of
from pgm_places.inference.labeling import Labeling

FIGURES: Mapping[str, Callable[[NDArray[np.generic]], NDArray[np.float64]]] = {
    "accuracy": metrics.accuracy,
    "balanced_accuracy": metrics.balanced_accuracy,
    "macro_f1": lambda counts: metrics.mean_of_defined(metrics.f1(counts)),
    "mean_iou": lambda counts: metrics.mean_of_defined(metrics.iou(counts)),
    "mcc": metrics.mcc,
}
TESTED = ("accuracy", "balanced_accuracy")
"""Figures whose differences are listed and tested over buildings."""

BY_LABEL: Mapping[str, Callable[[NDArray[np.generic]], NDArray[np.float64]]] = {
    "recall": metrics.recall,
    "precision": metrics.precision,
    "iou": metrics.iou,
}
LEVEL = 0.05
# With fewer buildings, the sign test cannot reach the level.
FEWEST_BUILDINGS = 6


@dataclass(frozen=True)
class Difference:
    """The difference of two methods in accuracy or balanced accuracy, the first minus the second.

    The 95 % interval is from common resampled blocks. ``buildings`` counts the buildings in which
    either method is better, ``by_seed`` has the difference for each common seed, ``values`` the
    figure of both methods.
    """

    first: str
    second: str
    figure: str
    interval: Interval
    buildings: SignTest
    by_seed: tuple[float, ...] = ()
    values: tuple[float, float] | None = None

    @property
    def shown(self) -> float:
        """The difference to show with both figures in percent with one decimal.

        It is the difference of the rounded figures, or the unrounded difference if these are equal.
        """
        if self.values is None:
            return self.interval.estimate
        first, second = (round(100 * value, 1) for value in self.values)
        return self.interval.estimate if first == second else round(first - second, 1) / 100

    @property
    def spread(self) -> float | None:
        """The standard deviation of the difference over the seeds; None for a single one."""
        return float(np.std(self.by_seed, ddof=1)) if len(self.by_seed) > 1 else None

    @property
    def seeds(self) -> SignTest:
        """Numbers of seeds for which either method is better; not a test on new buildings."""
        return SignTest.of(self.by_seed, [0.0] * len(self.by_seed))

    @property
    def winner(self) -> str | None:
        """The significantly better method, or None.

        The interval must exclude 0, and the sign test must agree if the two methods differ in at
        least ``FEWEST_BUILDINGS`` buildings.
        """
        low, high = self.interval.low, self.interval.high
        if not (low > 0 or high < 0):
            return None
        enough = self.buildings.better + self.buildings.worse >= FEWEST_BUILDINGS
        ahead = self.buildings.better > self.buildings.worse
        if enough and not (self.buildings.p_value < LEVEL and ahead == (low > 0)):
            return None
        return self.first if low > 0 else self.second

    def reversed(self) -> "Difference":
        """The difference with both methods exchanged."""
        old, signs = self.interval, self.buildings
        return Difference(
            self.second,
            self.first,
            self.figure,
            Interval(-old.estimate, -old.high, -old.low),
            SignTest(signs.worse, signs.better, signs.even),
            tuple(-value for value in self.by_seed),
            None if self.values is None else self.values[::-1],
        )


@dataclass(frozen=True)
class Significance:
    """Significance of the differences for every pair of methods in a comparison.

    ``leaders`` has, by figure (for labels such as ``recall of room``), the methods that are not
    significantly worse than the one with the highest value. A single one is significantly best.
    """

    differences: tuple[Difference, ...]
    leaders: Mapping[str, frozenset[str]]

    def best(self, figure: str) -> str | None:
        """The method that is significantly better than all others, or None."""
        leaders = self.leaders.get(figure, frozenset())
        return next(iter(leaders)) if len(leaders) == 1 else None

    def between(self, first: str, second: str, figure: str = "accuracy") -> Difference:
        """The difference of two methods, ``first`` minus ``second``."""
        for pair in self.differences:
            if pair.figure == figure and {pair.first, pair.second} == {first, second}:
                return pair if pair.first == first else pair.reversed()
        raise KeyError((first, second, figure))


def points(difference: float) -> str:
    """A difference of shares in percentage points, with its sign.

    Examples
    --------
    >>> points(0.015), points(-0.0002), points(0.0)
    ('+1.5', '-0.02', '0')
    """
    value = 100 * difference
    if not value:
        return "0"
    return f"{value:+.1f}" if abs(value) >= 0.1 else f"{value:+.2g}"


def resampled_counts(
    items: Sequence[TestItem], n_labels: int
) -> Callable[[Sequence[Sequence[Labeling]]], list[NDArray[np.int64]]]:
    """A function from labellings of each seed and item to (1 + R, K, K) counts of each seed.

    The counts are of all nodes, then of resampled blocks, the same for all labellings.
    """
    truth = np.concatenate([item.node_truth for item in items])
    resamples = Resamples.of(truth, blocks_of(items), n_labels=n_labels)
    return lambda repetitions: [
        resamples.confusions(np.concatenate([labeling.labels for labeling in of_seed]))
        for of_seed in repetitions
    ]


def judge(
    items: Sequence[TestItem],
    labelings: Mapping[str, Sequence[Sequence[Labeling]]],
    label_names: Sequence[str],
) -> Significance:
    """Compare all pairs of methods on the test items, for one seed or several common seeds.

    Figures are over all seeds, and differences are paired by seed: intervals resample seeds and
    blocks in common for both methods. The sign test over buildings uses figures over all seeds.
    ``labelings`` has, by the id of the method, a labelling of each seed and item.
    """
    if len(labelings) < 2:
        return Significance((), {})
    count, figures, by_seed = resampled_counts(items, len(label_names)), {}, {}
    for name, repetitions in labelings.items():
        counts = count(repetitions)
        figures[name] = _figures(pooled(counts), label_names)
        by_seed[name] = {f: [float(FIGURES[f](each[0])) for each in counts] for f in TESTED}
    by_building = {
        name: _by_building(items, of_method, len(label_names))
        for name, of_method in labelings.items()
    }
    differences = tuple(
        Difference(
            first,
            second,
            figure,
            Interval.of(figures[first][figure] - figures[second][figure]),
            SignTest.of(by_building[first][figure], by_building[second][figure]),
            _differences(by_seed[first][figure], by_seed[second][figure]),
            (float(figures[first][figure][0]), float(figures[second][figure][0])),
        )
        for figure in TESTED
        for first, second in combinations(labelings, 2)
    )
    leaders = {
        figure: _leaders({name: values[figure] for name, values in figures.items()})
        for figure in next(iter(figures.values()))
    }
    judged = Significance(differences, leaders)
    return Significance(differences, {**leaders, **{f: _tested(judged, f) for f in TESTED}})


def _differences(first: Sequence[float], second: Sequence[float]) -> tuple[float, ...]:
    """The difference for each seed; () for a single seed."""
    return tuple(a - b for a, b in zip(first, second, strict=True)) if len(first) > 1 else ()


def _figures(
    counts: NDArray[np.int64], label_names: Sequence[str]
) -> dict[str, NDArray[np.float64]]:
    """(1 + R,) values of each figure, for all nodes and for each resample."""
    figures = {name: figure(counts) for name, figure in FIGURES.items()}
    for kind, figure in BY_LABEL.items():
        values = figure(counts)
        figures |= {f"{kind} of {name}": values[:, k] for k, name in enumerate(label_names)}
    return figures


def _by_building(
    items: Sequence[TestItem], repetitions: Sequence[Sequence[Labeling]], n_labels: int
) -> dict[str, list[float]]:
    """The tested figures of a method in each building, over all seeds."""
    buildings = [item.building or f"item {index}" for index, item in enumerate(items)]
    figures: dict[str, list[float]] = {name: [] for name in TESTED}
    for building in dict.fromkeys(buildings):
        chosen = [k for k, name in enumerate(buildings) if name == building]
        truth = np.concatenate([items[k].node_truth for k in chosen])
        known, counts = truth >= 0, np.zeros((n_labels, n_labels), np.int64)
        for labelings in repetitions:
            labels = np.concatenate([labelings[k].labels for k in chosen])
            counts += metrics.confusion_matrix(truth[known], labels[known], n_labels)
        for name in TESTED:
            figures[name].append(float(FIGURES[name](counts)))
    return figures


def _leaders(values: Mapping[str, NDArray[np.float64]]) -> frozenset[str]:
    """The methods that are not significantly below the one with the highest value."""
    defined = {name: each for name, each in values.items() if not np.isnan(each[0])}
    if not defined:
        return frozenset()
    top = max(defined.values(), key=lambda each: float(each[0]))
    return frozenset(name for name, each in defined.items() if not Interval.of(top - each).low > 0)


def _tested(judged: Significance, figure: str) -> frozenset[str]:
    """The leaders in a figure with the sign test over buildings."""
    pairs = [pair for pair in judged.differences if pair.figure == figure]
    losers = {
        pair.first if pair.winner == pair.second else pair.second for pair in pairs if pair.winner
    }
    methods = {name for pair in pairs for name in (pair.first, pair.second)}
    return frozenset(methods - losers) or frozenset(methods)
