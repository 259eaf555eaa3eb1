"""A small model, and small maps as files."""

from pathlib import Path

import pytest

from pgm_places.datasets import generate_building
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.stored import save


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
