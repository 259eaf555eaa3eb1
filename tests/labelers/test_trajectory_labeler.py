import copy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import InputError, LabelError, ModelFileError, NotFittedError
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.persistence.stored import load, save
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.scan_model import BeamOptions
from tests.drives import building, drive
from tests.quick_labeler import places
from tests.refusals import refused

KNOWN = BeamOptions("known-map")
QUICK = DecisionListClassifier(n_rounds=20, order="heuristic")


@lru_cache
def labeler() -> TrajectoryLabeler:
    return TrajectoryLabeler.from_places(places())


def accuracy(path: Trajectory, labels: np.ndarray) -> float:
    assert path.labels is not None
    known = path.labels >= 0
    return float((labels[known] == path.labels[known]).mean())


def test_a_model_of_maps_labels_a_drive_with_a_front_laser() -> None:
    path = drive(1)
    found = labeler().label(path)
    assert found.labels.shape == (len(path),)
    assert accuracy(path, found.labels) > 0.8


def test_the_known_map_helps_a_laser_that_sees_only_half() -> None:
    path, (known, _) = drive(1), building()
    blind = labeler().with_options(beams=BeamOptions("max-range")).label(path)
    with_map = labeler().with_options(beams=KNOWN).label(path, known_map=known.grid)
    assert accuracy(path, with_map.labels) > accuracy(path, blind.labels)


def test_step_by_step_gives_the_beliefs_of_the_whole_log() -> None:
    path, (known, _) = drive(1)[:150], building()
    for every_m in (0.0, 0.25):
        for beams, known_map in ((BeamOptions(), None), (KNOWN, known.grid)):
            tool = labeler().with_options(every_m=every_m, beams=beams)
            whole = tool.label(path, known_map=known_map)
            assert path.geometry is not None
            online = tool.online(path.geometry, known_map=known_map)
            beliefs = [online.step(path.scan(t)) for t in range(len(path))]
            np.testing.assert_array_equal(whole.beliefs, np.array(beliefs))


def test_a_robot_that_stands_still_does_not_grow_ever_more_certain() -> None:
    path = drive(1)
    still = path.subset(np.zeros(60, np.int64))
    beliefs = labeler().label(still).beliefs
    assert beliefs is not None
    np.testing.assert_allclose(beliefs[-1], beliefs[5], atol=0.05)


@pytest.mark.parametrize("mode", ["smooth", "viterbi"])
def test_other_modes_label_whole_segments(mode: str) -> None:
    path = drive(1)
    found = labeler().with_options(method__mode=mode).label(path)
    assert accuracy(path, found.labels) > 0.8
    assert (found.beliefs is None) == (mode == "viterbi")


@pytest.mark.parametrize("name", ["relaxation", "amn", "independent"])
def test_any_method_labels_the_chain(name: str) -> None:
    tool = TrajectoryLabeler(building()[1], name, classifier=QUICK)
    tool.fit([], [drive(0), drive(2)])
    path = drive(1)
    assert accuracy(path, tool.label(path).labels) > 0.75
    with pytest.raises(InputError, match="hmm"):
        tool.online(path.geometry)  # type: ignore[arg-type]


def test_options_of_learning_reach_the_method(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}

    def learn(labeler: Any, method: Any, *_: Any) -> Any:
        options = ("every_m", "loop_m", "n_runs", "seed")
        asked.update({name: getattr(labeler, name) for name in options}, method=method)
        return method, None

    monkeypatch.setattr("pgm_places.labelers.trajectory_learning.learn_method", learn)
    tool = TrajectoryLabeler(
        building()[1], "amn", every_m=0.7, classifier=QUICK, loop_m=1.5, n_runs=17, seed=4
    )
    tool.fit([], [drive(0)])
    assert asked.pop("method").edge_features == ("constant", "kind")
    assert asked == {"every_m": 0.7, "loop_m": 1.5, "n_runs": 17, "seed": 4}


def test_maps_and_trajectories_are_learned_from_together() -> None:
    (known, names), path = building(), drive(0)
    tool = TrajectoryLabeler(names, classifier=QUICK, n_runs=200).fit([known], [path])
    assert accuracy(drive(1), tool.label(drive(1)).labels) > 0.75
    again = TrajectoryLabeler(names, classifier=QUICK, n_runs=200).fit([known], [path])
    np.testing.assert_array_equal(again.method_.transition, tool.method_.transition)


def test_extra_columns_are_learned_from_like_the_lasers_own() -> None:
    path, other = drive(0), drive(1)
    assert path.labels is not None and other.labels is not None
    names = building()[1]
    told = [np.eye(3, dtype=np.float32)[item.labels] for item in (path, other)]
    columns = [f"saw_{name}" for name in names]
    tool = TrajectoryLabeler(names, classifier=QUICK, extra_names=columns)
    tool.fit([], [path], extra=told[:1])
    assert accuracy(other, tool.label(other, extra=told[1]).labels) > 0.9
    assert other.geometry is not None
    belief = tool.online(other.geometry).step(other.scan(0), extra=told[1][0])
    assert belief.argmax() == other.labels[0]
    refused(InputError, "saw_", tool.label, other)
    refused(InputError, "laser only", labeler().label, other, extra=told[1])


def test_a_trajectory_without_scans_takes_them_from_the_known_map() -> None:
    path, (known, _) = drive(1), building()
    bare = Trajectory(path.times_s, path.poses)
    found = labeler().label(bare, known_map=known.grid)
    assert accuracy(path, found.labels) > 0.8
    refused(InputError, "no scans", labeler().label, bare)


def test_a_stored_model_of_maps_labels_trajectories(tmp_path: Path) -> None:
    path = drive(1)[:60]
    loaded = TrajectoryLabeler.from_places(load(save(places(), tmp_path / "maps")))
    np.testing.assert_array_equal(loaded.label(path).beliefs, labeler().label(path).beliefs)
    without = copy.copy(places())
    without.movement_ = None
    with pytest.raises(NotFittedError, match="train it again"):
        TrajectoryLabeler.from_places(load(save(without, tmp_path / "old")))


def test_a_damaged_model_is_refused(tmp_path: Path) -> None:
    save(labeler(), tmp_path / "model")
    manifest = tmp_path / "model" / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"local-map"', '"elsewhere"'))
    refused(ModelFileError, r"missing must be .*, got 'elsewhere'", load, tmp_path / "model")


def test_bad_input_is_refused_with_a_reason() -> None:
    known, names = building()
    path = drive(0)
    tool, cups = TrajectoryLabeler(names), TrajectoryLabeler(names, extra_names=["cups"])
    refused(NotFittedError, "this TrajectoryLabeler is not fitted yet", tool.label, path)
    with pytest.raises(NotFittedError, match="this PlaceLabeler is not fitted yet"):
        TrajectoryLabeler.from_places(PlaceLabeler(names))
    refused(NotFittedError, "this TrajectoryLabeler is not fitted yet", save, tool, "unused")
    refused(InputError, "nothing to train", tool.fit)
    with pytest.raises(InputError, match="no extra columns"):
        cups.fit([known], [path], extra=[np.zeros((len(path), 1))])
    refused(InputError, "must be given together", cups.fit, [], [path])
    with pytest.raises(InputError, match="1 trajectories but 2"):
        cups.fit([], [path], extra=[np.zeros((len(path), 1))] * 2)
    with pytest.raises(InputError, match="must have the labels"):
        tool.fit([], [Trajectory(path.times_s, path.poses, path.ranges_m, path.geometry)])
    with pytest.raises(LabelError, match="'kitchen'"):
        more = (*names, "kitchen")
        TrajectoryLabeler(more).fit([LabelledMap(known.grid, known.labels)])
    with pytest.raises(InputError, match="labelled trajectories"):
        TrajectoryLabeler(names, "relaxation").fit([known])
    with pytest.raises(
        InputError, match="every_m must be a number of at least 0 or 'auto', got -1"
    ):
        TrajectoryLabeler(names, every_m=-1.0).fit([known])


def test_scans_of_another_laser_are_refused_online() -> None:
    path = drive(1)
    online = labeler().online(ScanGeometry.full_circle(8, range_max_m=30.0))
    refused(InputError, "made for", online.step, path.scan(0))
    assert online.n_steps == 0


def test_impossible_observations_are_named_and_beliefs_stay_numbers() -> None:
    model: Any = HiddenMarkovModel(observation="hard", smoothing=0.0).with_counts(
        confusions=np.eye(3), moves=np.eye(3), first=[1, 0, 0]
    )
    model = replace(model, start="learned")
    tool = TrajectoryLabeler.of_parts(
        labeler().label_names_, model, labeler().scan_model_, every_m=0.0
    )
    path = drive(1)[:3]
    scores = np.log(np.eye(3)[[1, 0, 0]] * 0.7 + 0.1)
    found = tool.infer(path, scores)
    assert found.info["impossible"] == [0]
    assert found.beliefs is not None and np.isfinite(found.beliefs).all()


def test_the_distance_between_updates_is_chosen_reported_and_stored(tmp_path: Path) -> None:
    _, names = building()
    tool = TrajectoryLabeler(names, classifier=QUICK).fit([], [drive(0), drive(1)])
    assert tool.chosen_distance_ is not None
    assert tool.update_m == tool.chosen_distance_.every_m
    assert tool.method_choices["every_m"].startswith(f"{tool.update_m:g} (accuracy")
    save(tool, tmp_path / "model")
    again = load(tmp_path / "model")
    assert again.every_m == tool.update_m
    np.testing.assert_array_equal(again.label(drive(2)).labels, tool.label(drive(2)).labels)
    given = TrajectoryLabeler(names, every_m=0.3, classifier=QUICK).fit([], [drive(0), drive(1)])
    assert (given.update_m, given.method_choices) == (0.3, {})
    other = TrajectoryLabeler(names, "relaxation", classifier=QUICK).fit([], [drive(0)])
    assert (other.update_m, other.method_choices) == (0.1, {})
