"""A seed changes what is drawn while learning, and nothing else."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.experiment.config import parse_config
from pgm_places.experiment.config_changes import seeded_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import train
from pgm_places.experiment.setup import step_labeler
from pgm_places.options import plain_values
from tests.experiment.test_graph_runs import content

MAPS: dict[str, Any] = {
    "labels": {"names": ["corridor", "room"]},
    "train": [{"generated": 1}],
    "methods": [{"name": "relaxation"}],
}
DRIVES = {"train": [{"drive": {"generated": 1}}]}


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({}, {"classifier", "space"}),
        ({**DRIVES, "nodes": "steps"}, {"classifier", "steps"}),
        ({**DRIVES, "nodes": "both"}, {"classifier", "space", "steps"}),
        ({"base_model": "default", "methods": []}, {"teaching"}),
    ],
)
def test_all_that_draws_gets_the_seed_and_nothing_else_changes(
    changes: dict[str, Any], wanted: set[str]
) -> None:
    config = parse_config({**MAPS, **changes})
    before, after = plain_values(config), plain_values(seeded_config(config, 7))
    for part in wanted:
        assert after[part].pop("seed") == 7
        assert before[part].pop("seed") == 0
    assert after == before


def test_a_seed_alone_leaves_the_prior_of_the_list_of_steps_to_the_method() -> None:
    config = parse_config({**MAPS, **DRIVES, "nodes": "steps"})
    classifier = step_labeler(seeded_config(config, 3)).classifier
    assert classifier is not None
    assert (classifier.seed, classifier.prior_weight) == (3, 0.0)


def test_trees_with_few_features_each_depend_on_the_seed(tmp_path: Path) -> None:
    options = {"n_rounds": 5, "max_depth": 2, "feature_share": 0.4}
    config = parse_config(content(tmp_path, classifier=options))

    def scores(seed: int) -> Any:
        fitted = train(Experiment(seeded_config(config, seed), tmp_path)).labeler
        return fitted.classifier_.predict_proba(np.random.default_rng(0).normal(size=(50, 3)))

    np.testing.assert_array_equal(scores(1), scores(1))
    assert np.abs(scores(1) - scores(2)).max() > 0.01
