"""Options are chosen on held-out training cells: whole buildings or contiguous blocks."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import ConfigError, LabelError
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import train
from pgm_places.experiment.selection import Selection, SelectionCandidate, held_out_splits, select
from pgm_places.experiment.sources import SourceDrive, Sources
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.trajectories.scan import ScanGeometry


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
            # From lasers alone, which is learned faster than with spaces.
            "methods": [{"name": name, "unary": "laser"} for name in ("independent", "relaxation")],
            "select": select,
        }
    )


def labelled(maps: Sequence[LabelledMap]) -> int:
    return sum(int(item.labelled_cells.sum()) for item in maps)


def test_a_single_building_is_held_out_in_stripes_that_share_no_cell() -> None:
    known = small_map(1, "a")
    splits = list(held_out_splits(Sources([known]), 3, 3))
    assert splits
    held_out = np.zeros(known.grid.shape, np.int64)
    for learn, test in splits:
        [seen], [tested] = learn.maps, test.maps
        assert not (seen.labelled_cells & tested.labelled_cells).any()
        assert labelled(learn.maps) + labelled(test.maps) == labelled([known])
        columns = np.flatnonzero(tested.labelled_cells.any(axis=0))
        others = np.flatnonzero(seen.labelled_cells.any(axis=0))
        assert len(np.intersect1d(columns, others)) <= 2  # a stripe: columns meet at its borders
        held_out += tested.labelled_cells
    assert held_out.max() == 1


def test_several_buildings_are_held_out_whole() -> None:
    maps = [small_map(1, "a"), small_map(2, "b"), small_map(3, "a")]
    splits = list(held_out_splits(Sources(maps), 5, 3))
    tested = [sorted(item.name for item in test.maps) for _, test in splits]
    assert tested == [["map 1", "map 3"], ["map 2"]]


def drive(known: LabelledMap, building: str, length_m: float | None = None) -> SourceDrive:
    path = SimulatedRobot(ScanGeometry.half_circle(20, range_max_m=8.0)).explore(
        known.grid, max_length_m=length_m, name=f"drive through {known.name}"
    )
    path = path.labelled_by(known, ("corridor", "room", "doorway"))
    return SourceDrive(replace(path, building=building), known)


def test_drives_are_held_out_with_the_maps_of_their_building() -> None:
    maps = [small_map(1, "a"), small_map(2, "b")]
    sources = Sources(maps, [drive(maps[0], "a"), drive(maps[1], "b"), drive(maps[1], "c")])
    splits = list(held_out_splits(sources, 5, 3))
    names = [([m.name for m in test.maps], [d.building for d in test.drives]) for _, test in splits]
    assert names == [(["map 1"], ["a"]), (["map 2"], ["b"]), ([], ["c"])]


def test_folds_without_a_drive_to_test_are_skipped() -> None:
    maps = [small_map(1, "a"), small_map(2, "b")]
    [(learn, test)] = held_out_splits(Sources(maps, [drive(maps[1], "b")]), 5, 3)
    assert [item.name for item in learn.maps] == ["map 1"] and not learn.drives
    assert [item.building for item in test.drives] == ["b"]


def test_within_a_building_no_step_is_tested_on_a_stripe_that_was_learned() -> None:
    known = small_map(1, "a")
    sources = Sources([known], [drive(known, "a")])
    splits = list(held_out_splits(sources, 3, 3))
    assert len(splits) == 3
    tested = np.zeros(len(sources.drives[0].labels), np.int64)
    for learn, test in splits:
        [path], [seen] = test.drives, learn.maps
        steps = path.labels >= 0
        tested += steps
        assert not (steps & (learn.drives[0].labels >= 0)).any()
        under = known.grid.cells_at_m(path.positions_m[steps])
        learned = seen.labelled_cells[under[:, 0], under[:, 1]]
        assert learned.mean() < 0.1  # only where two stripes meet
    np.testing.assert_array_equal(tested == 1, sources.drives[0].labels >= 0)


def test_options_of_steps_are_chosen_on_drives_held_out() -> None:
    own = {"n_beams": 40, "range_m": 8.0}
    drives = [
        {"drive": {"generated": seed, "seed": seed, "length_m": 40.0, "laser": own}}
        for seed in (1, 2)
    ]
    content = {
        "nodes": "steps",
        "resolution_m": 0.2,
        "labels": {"names": ["corridor", "room", "doorway"]},
        "classifier": {"n_rounds": 3},
        "steps": {"n_runs": 20, "beams": {"missing": "mirror"}},
        "train": drives,
        "methods": [{"name": "independent"}, {"name": "potts", "weight": 0.0}],
        "select": {"options": {"methods.potts.weight": [0.0, 1.0]}, "n_folds": 2},
    }
    trained = train(Experiment(parse_config(content), Path()))
    experiment = trained.experiment
    assert experiment.selection is not None
    tried = experiment.selection["candidates"]
    assert [item["options"]["methods.potts.weight"] for item in tried] == [0.0, 1.0]
    assert all(len(item["by_fold"]) == 2 for item in tried) and tried[0] != tried[1]
    chosen = experiment.selection["chosen"]["methods.potts.weight"]
    assert trained.methods["potts"].backend.weight == chosen


def test_cells_and_steps_of_one_building_cannot_be_held_out_together() -> None:
    known = small_map(1, "a")
    content = {
        "nodes": "both",
        "labels": {"names": ["corridor", "room", "doorway"]},
        "train": [{"drive": {"generated": 1}}],
        "methods": [{"name": "potts"}],
        "select": {"options": {"methods.potts.weight": [1.0, 2.0]}},
    }
    experiment = Experiment(parse_config(content), Path())
    with pytest.raises(ConfigError, match="'both' holds out buildings"):
        select(experiment, Sources([], [drive(known, "a", 10.0)]))


def test_a_label_that_only_one_fold_has_cannot_be_held_out() -> None:
    known = small_map(1, "a")
    labels = np.where(np.arange(known.grid.shape[1]) < 5, known.labels, 0).astype(np.int16)
    with pytest.raises(LabelError, match="no fold can be held out"):
        list(held_out_splits(Sources([LabelledMap(known.grid, labels, building="a")]), 2, 3))


def test_every_combination_is_tried_and_the_best_is_chosen() -> None:
    options = {"classifier.n_rounds": [1, 8], "methods.relaxation.max_iterations": [1, 5]}
    experiment = Experiment(config(options=options, n_folds=2), Path())
    found = select(experiment, Sources([small_map(1, "a"), small_map(2, "b")]))
    assert [item.options for item in found.candidates] == [
        {"classifier.n_rounds": n, "methods.relaxation.max_iterations": i}
        for n in (1, 8)
        for i in (1, 5)
    ]
    assert found.method == "relaxation"
    assert found.chosen.score == max(item.score for item in found.candidates)
    assert found.to_dict()["chosen"] == found.chosen.options
    assert all(len(item.by_fold) == 2 for item in found.candidates)


def test_of_equal_scores_the_first_is_chosen() -> None:
    scores = (0.5, 0.75, 0.75)
    tried = tuple(SelectionCandidate({"n": n}, score, (score,)) for n, score in enumerate(scores))
    assert Selection("potts", "accuracy", tried).chosen.options == {"n": 1}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"options": {"classifier.rounds": [1]}}, "unknown key 'classifier.rounds'"),
        ({"options": {"classifier.n_rounds": list(range(1, 300))}}, "at most 200"),
        ({}, "select.options"),
        ({"options": {}}, "select.options"),
        ({"options": {"classifier.n_rounds": []}}, "select.options"),
        ({"options": {"classifier.n_rounds": [1]}, "method": "relax"}, "Did you mean 'relaxation'"),
        ({"options": {"classifier.n_rounds": [1]}, "criterion": "luck"}, "select.criterion"),
    ],
)
def test_options_are_checked_before_anything_is_learned(
    settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        select(Experiment(config(**settings), Path()), Sources([]))
