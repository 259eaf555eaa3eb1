"""Features from the cache are those that casting gives, and are computed once."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.datasets import generate_building
from pgm_places.experiment.feature_cache import FeatureCache
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import Silent
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary import training_cells
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
    cast = vars(training_cells)["iter_cast"]

    def counted(grid: Any, *rest: Any, **options: Any) -> Iterator[Any]:
        grown.append(grid)
        return iter(cast(grid, *rest, **options))

    monkeypatch.setattr(training_cells, "iter_cast", counted)
    return grown


def cells(maps: list[LabelledMap], limit: int | None, cache: FeatureCache | None) -> TrainingCells:
    return TrainingCells.of(maps, Sensor(), limit=limit, feature_cache=cache, progress=Silent())


@pytest.mark.parametrize("limit", [None, 40])
def test_features_are_the_same_and_cast_once(
    maps: list[LabelledMap], casts: list[Any], tmp_path: Path, limit: int | None
) -> None:
    plain, cache = cells(maps, limit, None), FeatureCache(tmp_path / "cache")
    del casts[:]
    for _ in range(2):
        cached = cells(maps, limit, cache)
        np.testing.assert_array_equal(cached.features, plain.features)
    assert len(casts) == 2
    of_all = dict(enumerate(np.concatenate([values for _, values in cached.blocks()])))
    numbers = np.concatenate([rows for rows, _ in cached.blocks()])
    for rows, values in plain.blocks():
        found = [of_all[index] for index in np.searchsorted(numbers, rows)]
        np.testing.assert_array_equal(found, values)


def test_a_map_is_known_by_its_content(maps: list[LabelledMap], tmp_path: Path) -> None:
    cache, item = FeatureCache(tmp_path), maps[0]
    key = cache.key(item, Sensor())
    assert cache.key(replace(item, name="other", building="other"), Sensor()) == key
    labels = np.where(item.labels == 1, np.int16(0), item.labels)
    assert cache.key(replace(item, labels=labels), Sensor()) == key
    window = np.zeros(item.grid.shape, np.bool_)
    window[:, : window.shape[1] // 2] = True
    others = {
        cache.key(maps[1], Sensor()),
        cache.key(replace(item, window=window), Sensor()),
        cache.key(item, Sensor(n_beams=180)),
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
