"""A method is called better only where it is, on the same blocks and over buildings."""

from collections.abc import Mapping, Sequence
from math import comb

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.evaluation.bootstrap import Interval, SignTest
from pgm_places.experiment.evaluated_items import EvalMap
from pgm_places.experiment.significance import Difference, Significance, judge
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.maps.occupancy_grid import OccupancyGrid

NAMES = ("corridor", "room")


def floor(building: str, truth: NDArray[np.int64]) -> EvalMap:
    """A free map of blocks of 2 m, a cell each."""
    grid = OccupancyGrid(np.zeros(truth.shape, np.int8), 2.0)
    layout = GridLayout.of_map(grid)
    window = np.ones(grid.shape, np.bool_)
    return EvalMap(building, grid, truth.astype(np.int16), layout, window, building)


def floors(n: int, seed: int = 0) -> list[EvalMap]:
    rng = np.random.default_rng(seed)
    return [floor(f"building {k}", rng.integers(0, 2, (12, 12))) for k in range(n)]


def wrong_at(items: Sequence[EvalMap], share: float, seed: int) -> list[Labeling]:
    """The truth, with this share of the cells wrong."""
    rng = np.random.default_rng(seed)
    found = []
    for item in items:
        wrong = rng.random(len(item.node_truth)) < share
        found.append(Labeling(np.where(wrong, 1 - item.node_truth, item.node_truth), Status.EXACT))
    return found


def judged(items: Sequence[EvalMap], labelings: Mapping[str, Sequence[Labeling]]) -> Significance:
    """Methods that were taught with one seed."""
    return judge(items, {name: [found] for name, found in labelings.items()}, NAMES)


def test_what_is_better_everywhere_is_the_best() -> None:
    items = floors(7)
    labelings = {"good": wrong_at(items, 0.02, 1), "bad": wrong_at(items, 0.2, 2)}
    found = judged(items, labelings)
    [accuracy, balanced] = found.differences
    assert (accuracy.figure, balanced.figure) == ("accuracy", "balanced_accuracy")
    assert accuracy.winner == balanced.winner == "good"
    assert accuracy.buildings == SignTest(7, 0, 0)
    assert accuracy.interval.low < accuracy.interval.estimate < accuracy.interval.high
    assert found.best("accuracy") == found.best("mcc") == found.best("recall of room") == "good"
    other = found.between("bad", "good")
    assert other.interval.estimate == -accuracy.interval.estimate
    assert other.winner == "good"
    assert other.buildings == SignTest(0, 7, 0)


def test_what_chance_explains_is_not_the_best() -> None:
    items = floors(7)
    labelings = {"one": wrong_at(items, 0.1, 1), "other": wrong_at(items, 0.1, 2)}
    found = judged(items, labelings)
    assert {item.winner for item in found.differences} == {None}
    assert found.best("accuracy") is None
    assert found.leaders["accuracy"] == {"one", "other"}


def test_equal_labellings_are_even_to_the_bit() -> None:
    items = floors(2)
    same = wrong_at(items, 0.1, 1)
    found = judged(items, {"one": same, "other": same})
    for item in found.differences:
        assert item.interval == Interval(0.0, 0.0, 0.0)
        assert item.buildings == SignTest(0, 0, 2)
        assert item.winner is None


def test_one_large_building_does_not_decide_against_six_others() -> None:
    """The blocks say that the first is better, the buildings that it is worse."""
    rng = np.random.default_rng(3)
    large = floor("large", rng.integers(0, 2, (80, 80)))
    items = [large, *floors(6)]
    first = [*wrong_at([large], 0.02, 1), *wrong_at(items[1:], 0.15, 2)]
    second = [*wrong_at([large], 0.3, 3), *wrong_at(items[1:], 0.02, 4)]
    found = judged(items, {"first": first, "second": second})
    accuracy = found.between("first", "second")
    assert accuracy.interval.low > 0
    assert accuracy.buildings == SignTest(1, 6, 0)
    assert accuracy.winner is None and found.best("accuracy") is None


def test_differences_are_paired() -> None:
    """Blocks that are hard for both widen both intervals, and not that of the difference."""
    truth = np.zeros((40, 40), np.int64)
    item = floor("a", truth)
    rng = np.random.default_rng(5)
    hard = rng.random(item.node_truth.shape) < 0.3
    easier = hard & (rng.random(hard.shape) < 0.9)
    labels = [Labeling(part.astype(np.int64), Status.EXACT) for part in (easier, hard)]
    found = judged([item], {"easier": [labels[0]], "hard": [labels[1]]})
    interval = found.between("easier", "hard").interval
    share = float((hard & ~easier).mean())
    half = 1.96 * np.sqrt(share * (1 - share) / hard.size)
    assert interval.estimate == pytest.approx(share, abs=1e-12)
    np.testing.assert_allclose(
        [interval.low, interval.high], [share - half, share + half], atol=3e-3
    )
    alone = 1.96 * np.sqrt(0.3 * 0.7 / hard.size)
    assert interval.high - interval.low < alone  # half of what two unpaired intervals would give


def test_one_method_has_nothing_to_be_judged_by() -> None:
    items = floors(1)
    found = judged(items, {"alone": wrong_at(items, 0.1, 1)})
    assert found.differences == () and found.best("accuracy") is None


@pytest.mark.parametrize(("better", "worse"), [(0, 0), (5, 0), (6, 0), (8, 2), (3, 3), (1, 9)])
def test_the_sign_test_counts_every_outcome(better: int, worse: int) -> None:
    n = better + worse
    uneven = abs(better - worse)
    wanted = sum(comb(n, k) for k in range(n + 1) if abs(2 * k - n) >= uneven) / 2**n
    assert SignTest(better, worse, 4).p_value == pytest.approx(wanted, rel=1e-12)


def test_a_label_that_is_nowhere_is_nobodys_best() -> None:
    items = [floor("a", np.zeros((12, 12), np.int64))]
    labelings = {"one": wrong_at(items, 0.0, 1), "other": wrong_at(items, 0.3, 2)}
    found = judged(items, labelings)
    assert found.leaders["recall of room"] == frozenset()
    assert found.best("recall of corridor") == "one"


def test_a_difference_needs_six_buildings_to_be_overruled() -> None:
    interval = Interval(0.1, 0.05, 0.2)
    assert Difference("a", "b", "accuracy", interval, SignTest(2, 3, 0)).winner == "a"
    assert Difference("a", "b", "accuracy", interval, SignTest(3, 3, 0)).winner is None
