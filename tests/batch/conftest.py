"""A small model, and small maps as files."""

from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.label_batch import LabelledBatch, label_batch
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelling.options import LabelOptions
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.stored import save
from pgm_places.progress import Silent
from pgm_places.simulation import generate_building
from tests.batch.shared import Batch, InProcessWorkers


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model that is learned in a second."""
    building = generate_building(size="small", resolution_m=0.2)
    labeler = PlaceLabeler(
        building.label_names,
        {"alone": PlaceMethod("independent", "laser")},
        classifier=DecisionListClassifier(n_rounds=3),
        max_examples_per_map=300,
        n_folds=2,
    )
    labeler.fit([LabelledMap(building.grid, building.labels)])
    return save(labeler, tmp_path_factory.mktemp("model") / "model")


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    """A folder of two maps, and one that is damaged."""
    folder = tmp_path / "maps"
    for seed in (1, 2):
        (folder / f"floor{seed}").mkdir(parents=True)
        save_map(
            generate_building(seed, size="small", resolution_m=0.2).grid,
            folder / f"floor{seed}" / "map",
        )
    (folder / "torn.yaml").write_text("image: torn.png\nresolution: 0.05\n")
    return folder


@pytest.fixture
def batch(model: Path, maps: Path) -> Batch:
    def run(
        workers: Any = None, *, force: bool = False, how: Any = MappingProxyType({}), **changes: Any
    ) -> LabelledBatch:
        out = maps.parent / "out"
        found = find_maps([str(maps)], out)
        options = LabelOptions(model=str(model), **changes)
        return label_batch(
            found,
            out,
            options,
            workers or InProcessWorkers(),
            force=force,
            progress=Silent(),
            **how,
        )

    return run


@pytest.fixture
def bucket(maps: Path) -> Iterator[Any]:
    """A file system in memory that holds the maps."""
    system = pytest.importorskip("fsspec").filesystem("memory")
    system.put(str(maps), "/maps", recursive=True)
    yield system
    system.rm("/", recursive=True)
