"""Runs on several splits and with several seeds are one comparison, whose parts can be seen."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.batch.several_runs import compare_several, run_tasks
from pgm_places.cli.terminal import comparison_table
from pgm_places.evaluation.bootstrap import Resamples, SignTest, pooled
from pgm_places.experiment.comparison import Comparison, over_seeds
from pgm_places.experiment.evaluated_items import blocks_of
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare
from pgm_places.experiment.significance import judge
from pgm_places.experiment.splits import splits_of
from pgm_places.report.comparison_files import comparison_record
from pgm_places.report.comparison_page import report_page
from tests.batch.shared import InProcessWorkers
from tests.experiment.test_significance import NAMES, floors, wrong_at
from tests.experiment.test_splits import experiment as of_graphs

DRAWN = {"n_rounds": 4, "max_depth": 2, "feature_share": 0.4}
METHODS = [
    {"name": "independent"},
    {"name": "amn", "id": "cut"},
    {"name": "amn", "id": "icm", "inference": "icm"},
]
SEEDS = (1, 2, 3)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    folder = tmp_path_factory.mktemp("graphs")
    return of_graphs(folder, methods=METHODS, classifier=DRAWN)


@pytest.fixture(scope="module")
def found(made: Experiment) -> Comparison:
    return compare_several(made, InProcessWorkers(), n_folds=2, seeds=SEEDS)


def test_figures_are_those_of_all_runs(made: Experiment, found: Comparison) -> None:
    tasks = run_tasks(made, splits_of(made, n_folds=2), SEEDS)
    alone = {
        (task.split, task.seed): compare(Experiment(task.config, made.folder)) for task in tasks
    }
    assert found.title == "Node labelling: 4 buildings in 2 folds, 3 seeds"
    assert found.seeds == SEEDS
    assert list(found.splits) == ["fold 1", "fold 2"]
    assert [item.name for item in found.maps] == [f"graph {n}" for n in (0, 2, 3, 1, 4)]
    for number, method in enumerate(found.methods):
        parts = {key: one.methods[number].evaluation for key, one in alone.items()}
        whole = np.sum([part.confusion for part in parts.values()], axis=0)
        np.testing.assert_array_equal(method.evaluation.confusion, whole)
        for seed in SEEDS:
            of_seed = np.sum([parts[f"fold {k}", seed].confusion for k in (1, 2)], axis=0)
            np.testing.assert_array_equal(method.by_seed[seed].evaluation.confusion, of_seed)
        for name, evaluation in found.by_split(method).items():
            of_split = np.sum([parts[name, seed].confusion for seed in SEEDS], axis=0)
            np.testing.assert_array_equal(evaluation.confusion, of_split)
        accuracies = [item.evaluation.accuracy for item in method.by_seed.values()]
        assert method.evaluation.accuracy == pytest.approx(np.mean(accuracies), rel=1e-12)
        spread = method.spread(lambda one: one.accuracy)
        assert spread == pytest.approx(np.std(accuracies, ddof=1), rel=1e-12)
        assert spread is not None and spread > 0
        interval = method.intervals["accuracy"]
        assert interval.low < interval.estimate < interval.high
        assert interval.estimate == pytest.approx(method.evaluation.accuracy, rel=1e-12)


def test_differences_are_paired_by_seed(found: Comparison) -> None:
    [alone, cut, _] = found.methods
    difference = found.judgement.between("cut", "independent")
    by_seed = [
        cut.by_seed[seed].evaluation.accuracy - alone.by_seed[seed].evaluation.accuracy
        for seed in SEEDS
    ]
    assert difference.by_seed == pytest.approx(by_seed)
    assert difference.spread == pytest.approx(np.std(by_seed, ddof=1))
    assert difference.seeds == SignTest.of(by_seed, [0.0] * 3)
    assert difference.reversed().by_seed == pytest.approx([-value for value in by_seed])
    assert difference.buildings.n_buildings == 4


def test_decoders_share_the_learning_of_each_run(found: Comparison) -> None:
    _, cut, icm = found.methods
    assert (cut.learned_with, icm.learned_with) == (None, "cut")
    assert cut.seconds["learn"] > 0 == icm.seconds["learn"]


def test_seeds_and_splits_are_reported(found: Comparison) -> None:
    record = comparison_record(found)
    assert record["seeds"] == [1, 2, 3]
    assert record["splits"]["fold 2"] == ["graph 1", "graph 4"]
    cut = record["methods"]["cut"]
    assert set(cut["by_seed"]) == {"1", "2", "3"} and set(cut["by_split"]) == {"fold 1", "fold 2"}
    assert all("spread" in item and len(item["by_seed"]) == 3 for item in record["differences"])
    table = comparison_table(found)
    assert "±: standard deviation over 3 seeds" in table and "Seeds: ahead" in table
    assert "Tested on" in table and "\nfold 2" in table
    page = report_page(found)
    assert "Accuracy / balanced accuracy by split" in page
    assert "with each of 3 seeds" in page and "Seeds: ahead / even / behind" in page
    assert page.count('class="seed"') == 9


def test_one_run_says_nothing_of_seeds_or_splits(made: Experiment) -> None:
    [task, *_] = run_tasks(made, splits_of(made, n_folds=2))
    found = compare(Experiment(task.config, made.folder))
    assert found.seeds == () and found.methods[0].spread(lambda one: one.accuracy) is None
    page, record = report_page(found), comparison_record(found)
    assert "by split" not in page and "Seeds" not in page and 'class="seed"' not in page
    assert record["seeds"] == [] and "by_seed" not in record["methods"]["cut"]
    assert all("by_seed" not in item for item in record["differences"])


def test_where_nothing_is_drawn_a_line_says_so(tmp_path: Path) -> None:
    plain = of_graphs(tmp_path, methods=METHODS[:1])
    found = compare_several(plain, InProcessWorkers(), n_folds=2, seeds=(1, 2))
    assert any("are equal for all 2 seeds" in line for line in found.warnings)
    assert found.methods[0].spread(lambda one: one.accuracy) == 0


def test_listed_splits_are_compared(tmp_path: Path) -> None:
    listed = [{"test": ["a"]}, {"test": ["a", "c"], "train": ["b"], "name": "from b"}]
    found = compare_several(of_graphs(tmp_path, splits=listed), InProcessWorkers())
    assert found.title == "Node labelling: 2 splits"
    assert found.splits == {"a": range(2), "from b": range(2, 5)}
    assert found.judgement.differences[0].buildings.n_buildings == 2


def test_what_two_splits_test_on_is_drawn_together() -> None:
    """Testing twice on the same nodes makes nothing surer, but on others it does."""
    items = floors(3)
    once = {"good": wrong_at(items, 0.1, 1), "bad": wrong_at(items, 0.2, 2)}
    twice = {name: [*found, *found] for name, found in once.items()}

    def width(many: list[Any], labelings: dict[str, Any]) -> float:
        found = judge(many, {n: [f] for n, f in labelings.items()}, NAMES).differences[0]
        return found.interval.high - found.interval.low

    same = blocks_of([*items, *items])
    np.testing.assert_array_equal(same[: len(same) // 2], same[len(same) // 2 :])
    assert width([*items, *items], twice) == pytest.approx(width(items, once))
    others = {"good": wrong_at(floors(6), 0.1, 1), "bad": wrong_at(floors(6), 0.2, 2)}
    assert width(floors(6), others) < 0.9 * width(items, once)


def test_methods_that_share_their_luck_are_even_to_the_bit() -> None:
    """Both methods of a pair get the same draws of seeds."""
    items = floors(3)
    found = [wrong_at(items, share, seed) for share, seed in ((0.05, 1), (0.2, 2), (0.4, 3))]
    [one, _] = judge(items, {"one": found, "twin": list(found)}, NAMES).differences
    assert (one.interval.low, one.interval.estimate, one.interval.high) == (0.0, 0.0, 0.0)
    assert one.by_seed == (0.0, 0.0, 0.0) and one.seeds == SignTest(0, 0, 3)


def test_luck_with_seeds_widens_the_interval() -> None:
    """A method that is good with one seed and bad with the other is not shown to be better."""
    items = floors(4)
    steady = [wrong_at(items, 0.2, seed) for seed in (1, 2)]
    lucky = [wrong_at(items, 0.02, 3), wrong_at(items, 0.3, 4)]
    [found, _] = judge(items, {"lucky": lucky, "steady": steady}, NAMES).differences
    assert found.interval.estimate > 0.02 and found.winner is None
    assert (found.seeds.better, found.seeds.worse) == (1, 1)
    always = {"lucky": [lucky[0]] * 2, "steady": steady}
    assert judge(items, always, NAMES).differences[0].winner == "lucky"


def test_repetitions_are_drawn_with_replacement() -> None:
    truth = np.arange(40) % 2
    resamples = Resamples.of(truth, np.arange(40), n_labels=2, n_resamples=400)
    right, wrong = resamples.confusions(truth), resamples.confusions(1 - truth)
    counts = pooled([right, wrong])
    shares = np.einsum("rkk->r", counts) / counts.sum(axis=(1, 2))
    assert shares[0] == 0.5
    values, times = np.unique(shares[1:].round(6), return_counts=True)
    assert values.tolist() == [0.0, 0.5, 1.0]
    np.testing.assert_allclose(times / 400, [0.25, 0.5, 0.25], atol=0.08)
    assert pooled([right]) is right


def test_choices_of_several_runs_are_named_where_they_differ(
    made: Experiment, found: Comparison
) -> None:
    parts = {
        seed: replace(found, choices=choices)
        for seed, choices in enumerate([{"a": "1", "b": "2"}, {"a": "1", "b": "3"}, {"a": "1"}])
    }
    pooled_run = over_seeds(made, parts)
    assert pooled_run.choices == {"a": "1", "b (seed 0)": "2", "b (seed 1)": "3"}
