"""Features from the cache are those that casting gives, and are computed once."""

import errno
import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import OutputError
from pgm_places.experiment.experiment import FeatureCache
from pgm_places.labelers.method import PlaceMethod
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.sensing.sensor import Sensor
from pgm_places.simulation import generate_building
from pgm_places.unary import feature_table
from pgm_places.unary.training_cells import TrainingCells


@pytest.fixture(scope="module")
def maps() -> list[LabelledMap]:
    found = []
    for seed in (1, 2):
        building = generate_building(seed, size="small", resolution_m=0.2)
        found.append(LabelledMap(building.grid, building.labels))
    return found


@pytest.fixture
def casts(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """A list that grows with every map that is cast."""
    grown: list[Any] = []
    cast = vars(feature_table)["iter_cast"]

    def counted(grid: Any, *rest: Any, **options: Any) -> Iterator[Any]:
        grown.append(grid)
        return iter(cast(grid, *rest, **options))

    monkeypatch.setattr(feature_table, "iter_cast", counted)
    return grown


BYTES_OF_CELL = 4 * 321


def cells(
    maps: list[LabelledMap], limit: int | None, cache: FeatureCache | None, **options: Any
) -> TrainingCells:
    return TrainingCells.of(maps, Sensor(), limit=limit, feature_cache=cache, **options)


@pytest.mark.parametrize("limit", [None, 40])
def test_features_are_the_same_and_cast_once(
    maps: list[LabelledMap], casts: list[Any], tmp_path: Path, limit: int | None
) -> None:
    plain, cache = cells(maps, limit, None), FeatureCache(tmp_path / "cache")
    del casts[:]
    for _ in range(2):
        cached = cells(maps, limit, cache, wants_all=True)
        np.testing.assert_array_equal(cached.features, plain.features)
    numbers, of_all = (np.concatenate(part) for part in zip(*cached.blocks(), strict=True))
    assert len(casts) == 2
    for rows, values in plain.blocks():
        np.testing.assert_array_equal(of_all[np.searchsorted(numbers, rows)], values)


def test_only_what_is_drawn_is_kept(
    maps: list[LabelledMap], casts: list[Any], tmp_path: Path
) -> None:
    plain, told = cells(maps, 40, None), list[str]()
    cache = FeatureCache(tmp_path / "cache", told.append)
    del casts[:]
    for _ in range(2):
        np.testing.assert_array_equal(cells(maps, 40, cache).features, plain.features)
    assert len(casts) == 2
    files = list(cache.folder.iterdir())
    assert sum(path.stat().st_size for path in files) == 2 * (40 * BYTES_OF_CELL + 128)
    assert told == [f"the features of 80 cells of 2 maps will take 0.1 MB in {cache.folder}"]
    np.testing.assert_array_equal(cells(maps[1:], 40, cache).features, plain.features[40:])
    assert len(casts) == 2  # beside other maps the same cells are drawn


def test_what_is_drawn_is_read_from_the_table_of_all(
    maps: list[LabelledMap], casts: list[Any], tmp_path: Path
) -> None:
    cache = FeatureCache(tmp_path)
    cells(maps, None, cache)
    plain = cells(maps, 40, None)
    del casts[:]
    np.testing.assert_array_equal(cells(maps, 40, cache).features, plain.features)
    assert not casts and len(list(tmp_path.iterdir())) == 2


def test_a_disk_without_room_is_refused_before_anything_is_cast(
    maps: list[LabelledMap], casts: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = FeatureCache(tmp_path / "new" / "cache")
    free = 80 * BYTES_OF_CELL
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    with pytest.raises(OutputError, match=r"of 80 cells of 2 maps need 0.1 MB in .* 0.1 MB "):
        cells(maps, 40, cache)
    assert not casts and not (tmp_path / "new").exists()
    cells(maps, 35, cache)
    assert len(casts) == 2


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="space is not reserved here")
def test_a_disk_that_others_have_filled_is_an_error_in_one_line(
    maps: list[LabelledMap], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OutputError, match=r"cannot write .*\.npy: No space left on device"):
        cells(maps, 40, FeatureCache(tmp_path))
    assert not list(tmp_path.iterdir())


def test_a_map_is_known_by_its_content(maps: list[LabelledMap], tmp_path: Path) -> None:
    cache, item = FeatureCache(tmp_path), maps[0]
    mask = item.labelled_cells
    key = cache.key(item, Sensor(), mask)
    assert cache.key(replace(item, name="other", building="other"), Sensor(), mask) == key
    labels = np.where(item.labels == 1, np.int16(0), item.labels)
    assert cache.key(replace(item, labels=labels), Sensor(), mask) == key
    window = np.zeros(item.grid.shape, np.bool_)
    window[:, : window.shape[1] // 2] = True
    others = {
        cache.key(maps[1], Sensor(), maps[1].labelled_cells),
        cache.key(item, Sensor(), mask & window),
        cache.key(item, Sensor(n_beams=180), mask),
    }
    assert len(others | {key}) == 4


def test_a_damaged_table_is_computed_again(
    maps: list[LabelledMap], casts: list[Any], tmp_path: Path
) -> None:
    cache = FeatureCache(tmp_path)
    before = cells(maps[:1], None, cache).features
    [path] = tmp_path.glob("*.npy")
    path.write_bytes(path.read_bytes()[:5000])
    np.testing.assert_array_equal(cells(maps[:1], None, cache).features, before)
    assert len(casts) == 2


def test_a_labeler_keeps_all_cells_only_where_it_scores_all(
    maps: list[LabelledMap], tmp_path: Path
) -> None:
    n_cells = int(maps[0].labelled_cells.sum())
    unary: Any
    for unary, expected in (("laser", 200), ("context", n_cells)):
        labeler = PlaceLabeler(
            ("corridor", "room", "doorway"),
            {"method": PlaceMethod("independent", unary)},
            classifier=DecisionListClassifier(n_rounds=2),
            context_m=(0.5,),
            max_examples_per_map=200,
            n_folds=2,
        )
        labeler.fit(maps[:1], feature_cache=FeatureCache(tmp_path / unary))
        [path] = (tmp_path / unary).iterdir()
        assert len(np.load(path)) == expected
