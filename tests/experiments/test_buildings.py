"""Buildings left out: nothing that scores a building has seen it, and a stopped run goes on."""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.buildings import lists, maps
from experiments.buildings.lists import AVERAGE, Scored, scored_maps
from experiments.buildings.maps import (
    DRAWN,
    NAMES,
    SIMULATED,
    KnownMap,
    Sample,
    building_numbers,
    sampled_maps,
)
from experiments.buildings.scores import RESCALED, rescaled
from experiments.kept import KeptArrays, fingerprint
from experiments.paper.setting import Setting
from pgm_places.datasets import LabelledBuilding, generate_building
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.unary.options import SpaceOptions


def small_building(seed: int, **_: object) -> LabelledBuilding:
    """A building of a few rooms, whatever style is wanted."""
    return generate_building(seed, size="small", resolution_m=0.1)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What was learned for one test, for all others that ask for the same."""
    return tmp_path_factory.mktemp("buildings") / "kept"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, kept: Path) -> Setting:
    """Two buildings with a robot-like copy each, a generated one, and few rounds of boosting."""
    monkeypatch.setattr(maps, "generate_building", small_building)
    monkeypatch.setattr(maps, "STAND_INS", ("school", "office"))
    monkeypatch.setattr(maps, "GENERATED_STYLES", ("office",))
    monkeypatch.setattr(maps, "PER_STYLE", 1)
    monkeypatch.setattr(maps, "EXAMPLES_PER_MAP", 200)
    quick = functools.partial(SpaceOptions, n_rounds=5)
    monkeypatch.setattr(lists, "SpaceOptions", quick)
    return Setting(kept=kept)


def test_a_stopped_run_goes_on(small: Setting, monkeypatch: pytest.MonkeyPatch) -> None:
    samples = sampled_maps(small)
    fold = building_numbers(samples, 2)
    found = scored_maps(small, samples, fold)

    def forbidden(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(maps, "training_features", forbidden)
    monkeypatch.setattr(maps, "simulate_map", forbidden)
    monkeypatch.setattr(lists, "gate_list", forbidden)
    for one, other in zip(found, scored_maps(small, sampled_maps(small), fold), strict=True):
        assert all(np.array_equal(one.log_z[name], other.log_z[name]) for name in one.log_z)
        assert np.array_equal(one.gate, other.gate)


def test_the_labels_of_a_building_do_not_change_its_own_scores(small: Setting) -> None:
    samples = sampled_maps(small)
    fold = building_numbers(samples, 2)
    before = scored_maps(small, samples, fold)
    changed = [_relabelled(each) if fold[k] == 0 else each for k, each in enumerate(samples)]
    after = scored_maps(Setting(), changed, fold)
    for one, other in zip(before, after, strict=True):
        same = [np.array_equal(one.log_z[name], other.log_z[name]) for name in one.log_z]
        assert all(same) == (one.fold == 0)
        assert np.array_equal(one.gate, other.gate) == (one.fold == 0)


def _relabelled(sample: Sample) -> Sample:
    """The same cells with other labels."""
    item = sample.known.item
    labels = np.where(item.labels >= 0, (item.labels + 1) % 3, -1)
    known = replace(sample.known, item=replace(item, labels=labels))
    return replace(sample, known=known)


def test_copies_share_the_fold_of_their_plan_and_generated_buildings_are_never_tested(
    small: Setting,
) -> None:
    samples = sampled_maps(small)
    fold = building_numbers(samples, 2)
    by_name = {each.known.item.name: k for k, each in zip(fold, samples, strict=True)}
    for each, number in zip(samples, fold, strict=True):
        if each.known.source == SIMULATED:
            assert by_name[each.known.item.name.removesuffix(", simulated")] == number
    assert sorted(fold.tolist()) == [0, 0, 1, 1, 2]
    assert {item.fold for item in scored_maps(small, samples, fold)} == {0, 1}


@pytest.mark.parametrize("how", RESCALED)
def test_rescaling_calms_lists_that_are_too_sure(how: str) -> None:
    scored = [_drawn_from_beliefs(seed) for seed in range(2)]
    errors = []
    for every in ([item.log_z[AVERAGE] for item in scored], rescaled(scored, how)):
        parts = [
            evaluate(item.truth, log_z.argmax(axis=1), NAMES, beliefs=np.exp(log_z))
            for item, log_z in zip(scored, every, strict=True)
        ]
        errors.append(Evaluation.merged(parts).expected_calibration_error or 0.0)
    assert errors[0] > 0.1
    assert errors[1] < 0.02


def _drawn_from_beliefs(seed: int) -> Scored:
    """A map in fold ``seed`` whose labels are drawn from beliefs, and log z of twice the odds."""
    rng = np.random.default_rng(seed)
    belief = rng.dirichlet([1.0, 1.0, 0.5], 10_000)
    labels = np.full((400, 400), -1, np.int16)
    labels[::4, ::4] = (
        (rng.random((10_000, 1)) > belief.cumsum(axis=1)).sum(axis=1).reshape(100, -1)
    )
    item = LabelledMap(OccupancyGrid(np.zeros((400, 400), np.int8), 0.05), labels)
    log_z = 2 * np.log(np.maximum(belief, 1e-6))
    log_z -= np.logaddexp.reduce(log_z, axis=1, keepdims=True)
    sample = Sample(KnownMap(item, "school", DRAWN), KeptArrays(None), "")
    return Scored(sample, seed, {AVERAGE: log_z}, np.zeros(10_000, np.float32), np.zeros(0))


def test_maps_that_are_not_learned_from_change_nothing(small: Setting) -> None:
    samples = sampled_maps(small)
    fold, learned = building_numbers(samples, 2), np.arange(len(samples)) > 0
    before = scored_maps(small, samples, fold, learned=learned)
    first = _relabelled(samples[0])
    after = scored_maps(Setting(), [first, *samples[1:]], fold, learned=learned)
    for one, other in zip(before, after, strict=True):
        assert all(np.array_equal(one.log_z[name], other.log_z[name]) for name in one.log_z)
        assert np.array_equal(one.gate, other.gate)
    whole = scored_maps(small, samples, fold)
    assert any(
        not np.array_equal(one.log_z[AVERAGE], other.log_z[AVERAGE])
        for one, other in zip(before, whole, strict=True)
    )


def test_damaged_files_are_made_again(tmp_path: Path) -> None:
    kept = KeptArrays(tmp_path)
    assert not kept.has("a")
    kept.arrays("a", lambda: {"x": np.arange(3)})
    assert kept.has("a")
    (tmp_path / "a.npz").write_bytes(b"PK\x03\x04")
    assert not kept.has("a")
    assert kept.arrays("a", lambda: {"x": np.arange(2)})["x"].tolist() == [0, 1]


def test_fingerprints_tell_arrays_and_options_apart() -> None:
    assert fingerprint(np.arange(3), 1) == fingerprint(np.arange(3), 1)
    assert fingerprint(np.arange(3), 1) != fingerprint(np.arange(3), 2)
    assert fingerprint(np.arange(3)) != fingerprint(np.arange(4))
