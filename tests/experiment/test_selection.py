"""Options are chosen on held-out training cells: whole buildings or contiguous blocks."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.datasets import generate_building
from pgm_places.errors import ConfigError, LabelError
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.selection import held_out_splits, select
from pgm_places.maps.labelled_map import LabelledMap


def small_map(seed: int, building: str) -> LabelledMap:
    made = generate_building(seed, size="small", resolution_m=0.2)
    return LabelledMap(made.grid, made.labels, name=f"map {seed}", building=building)


def config(**select: Any) -> ExperimentConfig:
    return parse_config(
        {
            "labels": {"names": ["corridor", "room", "doorway"]},
            "train": [{"generated": 1}],
            "classifier": {"n_rounds": 3, "learn_on": "in-sample"},
            "context": {"half_widths_m": []},
            "methods": [{"name": "independent"}, {"name": "relaxation"}],
            "select": select,
        }
    )


def labelled(maps: list[LabelledMap]) -> int:
    return sum(int(item.labelled_cells.sum()) for item in maps)


def test_a_single_building_is_held_out_in_stripes_that_share_no_cell() -> None:
    known = small_map(1, "a")
    splits = list(held_out_splits([known], 3, 3))
    assert splits
    held_out = np.zeros(known.grid.shape, np.int64)
    for learn, test in splits:
        [seen], [tested] = learn, test
        assert not (seen.labelled_cells & tested.labelled_cells).any()
        assert labelled(learn) + labelled(test) == labelled([known])
        columns = np.flatnonzero(tested.labelled_cells.any(axis=0))
        others = np.flatnonzero(seen.labelled_cells.any(axis=0))
        assert len(np.intersect1d(columns, others)) <= 2  # a stripe: columns meet at its borders
        held_out += tested.labelled_cells
    assert held_out.max() == 1


def test_several_buildings_are_held_out_whole() -> None:
    maps = [small_map(1, "a"), small_map(2, "b"), small_map(3, "a")]
    splits = list(held_out_splits(maps, 5, 3))
    tested = [sorted(item.name for item in test) for _, test in splits]
    assert tested == [["map 1", "map 3"], ["map 2"]]


def test_a_label_that_only_one_fold_has_cannot_be_held_out() -> None:
    known = small_map(1, "a")
    labels = np.where(np.arange(known.grid.shape[1]) < 5, known.labels, 0).astype(np.int16)
    with pytest.raises(LabelError, match="no fold can be held out"):
        list(held_out_splits([LabelledMap(known.grid, labels, building="a")], 2, 3))


def test_every_combination_is_tried_and_the_best_is_chosen() -> None:
    options = {"classifier.n_rounds": [1, 8], "methods.relaxation.max_iterations": [1, 5]}
    experiment = Experiment(config(options=options, n_folds=2), Path())
    found = select(experiment, [small_map(1, "a"), small_map(2, "b")])
    assert [item.options for item in found.candidates] == [
        {"classifier.n_rounds": n, "methods.relaxation.max_iterations": i}
        for n in (1, 8)
        for i in (1, 5)
    ]
    assert found.method == "relaxation"
    assert found.chosen.score == max(item.score for item in found.candidates)
    assert found.to_dict()["chosen"] == found.chosen.options
    assert all(len(item.by_fold) == 2 for item in found.candidates)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"options": {"classifier.rounds": [1]}}, "unknown key 'classifier.rounds'"),
        ({"options": {"classifier.n_rounds": list(range(1, 300))}}, "at most 200"),
    ],
)
def test_options_are_checked_before_anything_is_learned(
    settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        select(Experiment(config(**settings), Path()), [])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "select.options"),
        ({"options": {}}, "select.options"),
        ({"options": {"classifier.n_rounds": []}}, "select.options"),
        ({"options": {"classifier.n_rounds": [1]}, "method": "relax"}, "did you mean 'relaxation'"),
        ({"options": {"classifier.n_rounds": [1]}, "criterion": "luck"}, "select.criterion"),
    ],
)
def test_a_bad_table_is_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        config(**settings)
