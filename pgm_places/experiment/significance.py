"""Significance of differences between methods on the same nodes and buildings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation import confusion
from pgm_places.evaluation.bootstrap import Interval, Resamples, SignTest, pooled
from pgm_places.experiment.evaluated_items import TestItem, blocks_of
from pgm_places.inference.labeling import Labeling

FIGURES: Mapping[str, Callable[[NDArray[np.generic]], NDArray[np.float64]]] = {
    "accuracy": confusion.accuracy,
    "balanced_accuracy": confusion.balanced_accuracy,
    "macro_f1": lambda counts: confusion.mean_of_defined(confusion.f1(counts)),
    "mean_iou": lambda counts: confusion.mean_of_defined(confusion.iou(counts)),
    "mcc": confusion.mcc,
}
TESTED = ("accuracy", "balanced_accuracy")
"""Figures whose differences are listed and tested over buildings."""

BY_LABEL: Mapping[str, Callable[[NDArray[np.generic]], NDArray[np.float64]]] = {
    "recall": confusion.recall,
    "precision": confusion.precision,
    "iou": confusion.iou,
}
LEVEL = 0.05
# Fewer cannot reach the level, even if one method is better in all of them.
FEWEST_BUILDINGS = 6


@dataclass(frozen=True)
class Difference:
    """How much more of a figure the first method has than the second.

    Parameters
    ----------
    first, second : str
        The ids of the methods.
    figure : str
        ``accuracy`` or ``balanced_accuracy``.
    interval : Interval
        The difference with its 95 % interval, of both methods on the same resampled blocks.
    buildings : SignTest
        In how many buildings the first has more.
    by_seed : tuple of float
        The difference with each seed, where the methods were taught with several; both methods of a
        pair have the same one.
    values : (float, float), optional
        The figure of both methods.
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
        """The difference that goes with both figures in percent with one decimal.

        It is that of the rounded figures, or the difference itself where these are alike.
        """
        if self.values is None:
            return self.interval.estimate
        first, second = (round(100 * value, 1) for value in self.values)
        return self.interval.estimate if first == second else round(first - second, 1) / 100

    @property
    def spread(self) -> float | None:
        """The standard deviation of the difference over the seeds; None of a single one."""
        return float(np.std(self.by_seed, ddof=1)) if len(self.by_seed) > 1 else None

    @property
    def seeds(self) -> SignTest:
        """With how many seeds the first has more; no test, for seeds are no new buildings."""
        return SignTest.of(self.by_seed, [0.0] * len(self.by_seed))

    @property
    def winner(self) -> str | None:
        """The method that is better beyond chance; None where neither is.

        The interval must leave out 0 and, with ``FEWEST_BUILDINGS`` buildings or more in which the
        two differ, the sign test must agree.
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
        """The same from the second method's side."""
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
    """What the comparison shows, and what it leaves open.

    Parameters
    ----------
    differences : tuple of Difference
        Of every pair of methods in accuracy and balanced accuracy.
    leaders : mapping of str to frozenset of str
        By figure (of labels such as ``recall of room``), the methods that are not shown to be worse
        than the one with the highest value. A single one is the best.
    """

    differences: tuple[Difference, ...]
    leaders: Mapping[str, frozenset[str]]

    def best(self, figure: str) -> str | None:
        """The method that is better than all others beyond chance; None where there is none."""
        leaders = self.leaders.get(figure, frozenset())
        return next(iter(leaders)) if len(leaders) == 1 else None

    def between(self, first: str, second: str, figure: str = "accuracy") -> Difference:
        """The difference of two methods, from the side of the first."""
        for item in self.differences:
            if item.figure == figure and {item.first, item.second} == {first, second}:
                return item if item.first == first else item.reversed()
        raise KeyError((first, second, figure))


def points(difference: float) -> str:
    """A difference of shares in points with its sign, so that its side of 0 is seen.

    Examples
    --------
    >>> points(0.015), points(-0.0002), points(0.0)
    ('+1.5', '-0.02', '0')
    """
    value = 100 * difference
    if not value:
        return "0"
    return f"{value:+.1f}" if abs(value) >= 0.1 else f"{value:+.2g}"


def judge(
    items: Sequence[TestItem],
    labelings: Mapping[str, Sequence[Sequence[Labeling]]],
    label_names: Sequence[str],
) -> Significance:
    """All methods against each other on what was tested, taught with one seed or the same several.

    Figures are of all seeds together, and differences paired by seed: the intervals draw seeds and
    blocks, the same for both methods. A building counts for the method that has more there with all
    seeds together.

    Parameters
    ----------
    items : sequence of TestItem
    labelings : mapping of str to sequence of sequence of Labeling
        Of each seed and item, by the id of the method.
    label_names : sequence of K str
    """
    if len(labelings) < 2:
        return Significance((), {})
    resamples = Resamples.of(
        np.concatenate([item.node_truth for item in items]),
        blocks_of(items),
        n_labels=len(label_names),
    )
    figures, by_seed = {}, {}
    for name, repetitions in labelings.items():
        counts = [
            resamples.confusions(np.concatenate([item.labels for item in found]))
            for found in repetitions
        ]
        figures[name] = _figures(pooled(counts), label_names)
        by_seed[name] = {f: [float(FIGURES[f](part[0])) for part in counts] for f in TESTED}
    by_building = {
        name: _by_building(items, found, len(label_names)) for name, found in labelings.items()
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
        figure: _leaders({name: found[figure] for name, found in figures.items()})
        for figure in next(iter(figures.values()))
    }
    judged = Significance(differences, leaders)
    return Significance(differences, {**leaders, **{f: _tested(judged, f) for f in TESTED}})


def _differences(first: Sequence[float], second: Sequence[float]) -> tuple[float, ...]:
    """The difference with each seed; () where there is one."""
    return tuple(a - b for a, b in zip(first, second, strict=True)) if len(first) > 1 else ()


def _figures(
    counts: NDArray[np.int64], label_names: Sequence[str]
) -> dict[str, NDArray[np.float64]]:
    """(1 + R,) of each figure, of the whole and of each resample."""
    figures = {name: figure(counts) for name, figure in FIGURES.items()}
    for kind, figure in BY_LABEL.items():
        values = figure(counts)
        figures |= {f"{kind} of {name}": values[:, k] for k, name in enumerate(label_names)}
    return figures


def _by_building(
    items: Sequence[TestItem], repetitions: Sequence[Sequence[Labeling]], n_labels: int
) -> dict[str, list[float]]:
    """The tested figures of a method in each building, with all seeds together."""
    buildings = [item.building or f"item {index}" for index, item in enumerate(items)]
    found: dict[str, list[float]] = {name: [] for name in TESTED}
    for building in dict.fromkeys(buildings):
        chosen = [k for k, name in enumerate(buildings) if name == building]
        truth = np.concatenate([items[k].node_truth for k in chosen])
        known, counts = truth >= 0, np.zeros((n_labels, n_labels), np.int64)
        for labelings in repetitions:
            labels = np.concatenate([labelings[k].labels for k in chosen])
            counts += confusion.confusion_matrix(truth[known], labels[known], n_labels)
        for name in TESTED:
            found[name].append(float(FIGURES[name](counts)))
    return found


def _leaders(values: Mapping[str, NDArray[np.float64]]) -> frozenset[str]:
    """The methods that are not shown to have less of a figure than the one with most of it."""
    defined = {name: found for name, found in values.items() if not np.isnan(found[0])}
    if not defined:
        return frozenset()
    top = max(defined.values(), key=lambda found: float(found[0]))
    return frozenset(
        name for name, found in defined.items() if not Interval.of(top - found).low > 0
    )


def _tested(judged: Significance, figure: str) -> frozenset[str]:
    """The same where the buildings have their say, too."""
    pairs = [item for item in judged.differences if item.figure == figure]
    losers = {
        item.first if item.winner == item.second else item.second for item in pairs if item.winner
    }
    everyone = {name for item in pairs for name in (item.first, item.second)}
    return frozenset(everyone - losers) or frozenset(everyone)
