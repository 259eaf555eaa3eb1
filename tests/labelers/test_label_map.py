"""Maps of any resolution, labelled by a model of 5 cm, and what is written of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pgm_places import LabelGraph, OccupancyGrid, PlaceLabeler
from pgm_places.errors import MapError
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.io.places.exports import write_geotiff
from pgm_places.io.places.result_folder import probability_file
from pgm_places.labelers.labelled_places import LabelledPlaces, _brought_back
from pgm_places.labelers.method import PlaceMethod
from pgm_places.labelling import label as labelling
from pgm_places.labelling.files import write_labels
from pgm_places.maps.coarsening import coarsen, refine
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.progress import Silent, Stage
from pgm_places.simulation import LabelledBuilding, generate_building
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.regions import Region
from pgm_places.trained import trained_labeler
from pgm_places.unary.options import SpaceOptions

FINER = (0.04, 0.05 / 1.5, 0.025, 0.02, 0.015, 0.005)  # by 1.25, 1.5, 2, 2.5, 3.33, 10
COARSER = (0.06, 0.1, 0.2, 1.0)
CROP = np.s_[:100, :160]
label_map = partial(labelling.label_map, entered=EnteredOptions(unentered=True))


@cache
def building() -> LabelledBuilding:
    return generate_building(9, size="small", resolution_m=0.05)


@cache
def labeler() -> PlaceLabeler:
    return trained_labeler("generated")


@cache
def labelled(resolution_m: float) -> LabelledPlaces:
    grid = building().grid
    if resolution_m < 0.05:
        corner = grid.with_cells(grid.cells[CROP])
        return label_map(labeler(), refine(corner, resolution_m))
    coarse = coarsen(grid, resolution_m, occupied_share=None if resolution_m < 0.5 else 0.5)
    return label_map(labeler(), coarse)


@pytest.mark.parametrize("resolution_m", [*FINER, *COARSER])
def test_every_free_cell_gets_a_label_and_places_the_mean_of_their_cells(
    resolution_m: float, tmp_path: Path
) -> None:
    found = labelled(resolution_m)
    assert ((found.labels >= 0) == found.grid.free).all()
    [note] = found.warnings
    assert f"resampled from {resolution_m:g} m to 0.05 m cells for the model" in note
    assert ("original resolution" if resolution_m < 0.05 else "most frequent label") in note
    beliefs = found.labeling.beliefs
    assert beliefs is not None
    on_map = found.on_map(beliefs, 0)
    np.testing.assert_allclose(on_map.sum(axis=2), found.labels >= 0, rtol=0, atol=1e-5)
    write_labels(found, load_map(save_map(found.grid, tmp_path / "map")), tmp_path)
    images = [
        np.asarray(Image.open(tmp_path / probability_file(name)))[::-1]
        for name in found.label_names
    ]
    sums = np.stack(images).sum(axis=0, dtype=np.int64)
    assert (sums[found.labels < 0] == 0).all()
    assert (np.abs(sums[found.labels >= 0] - 255) <= 1).all()  # each is rounded
    places = topological_map(
        found.grid, found.labels, found.label_names, beliefs=beliefs, layout=found.layout
    )
    for region in places.regions:
        inside = places.region == region.id
        mean = on_map[inside][:, found.label_names.index(region.label)].mean(dtype=np.float64)
        assert region.confidence == pytest.approx(mean, rel=1e-5)
    with Image.open(write_geotiff(tmp_path / "regions.tif", places)) as image:
        assert (np.asarray(image)[::-1] == places.region).all()
    if resolution_m in FINER:  # labels are those of the map of the model's cells
        grid = building().grid
        own = label_map(labeler(), grid.with_cells(grid.cells[CROP]))
        cells = np.argwhere(found.grid.free)
        there = own.grid.cells_at_m(found.grid.cell_centres_m(cells))
        same = own.labels[there[:, 0], there[:, 1]] == found.labels[cells[:, 0], cells[:, 1]]
        assert same.mean() > 0.95


@pytest.mark.parametrize("resolution_m", [0.0184, 0.0508, 0.0746, 0.1203])
def test_maps_of_odd_resolutions_are_labelled(resolution_m: float) -> None:
    rows, columns = (int(length_m / resolution_m) for length_m in (7.0, 9.0))
    cells = np.where(np.random.default_rng(0).random((rows, columns)) < 0.02, 100, 0)
    cells[:, columns // 2] = np.where(np.arange(rows) < rows // 5, 0, 100)
    found = label_map(labeler(), OccupancyGrid(cells, resolution_m))
    assert ((found.labels >= 0) == found.grid.free).all()
    beliefs = found.labeling.beliefs
    assert beliefs is not None
    np.testing.assert_allclose(
        found.on_map(beliefs, 0).sum(axis=2), found.grid.free, rtol=0, atol=1e-5
    )


@pytest.mark.parametrize(("resolution_m", "least"), [(0.06, 0.9), (0.1, 0.9), (0.2, 0.85)])
def test_labels_of_a_coarser_map_are_mostly_right(resolution_m: float, least: float) -> None:
    found = labelled(resolution_m)
    cells = np.argwhere(found.labels >= 0)
    there = building().grid.cells_at_m(found.grid.cell_centres_m(cells))
    truth = building().labels[there[:, 0], there[:, 1]]
    right = truth == found.labels[cells[:, 0], cells[:, 1]]
    assert right[truth >= 0].mean() > least


def test_parts_vote_and_their_probabilities_are_averaged() -> None:
    grid = OccupancyGrid(np.array([[0, 0, 100]]), resolution_m=0.1)
    fine = refine(grid, 0.05)
    cells = LabelGraph.from_grid(fine).layout
    assert isinstance(cells, GridLayout)
    layout = GridLayout.of_map(grid)
    labels = np.array([1, 1, 2, 2, 1, 0, 2, 0])  # two rows of four cells
    beliefs = np.eye(3)[labels]
    beliefs[0] = [0.5, 0.5, 0.0]
    found = _brought_back(Labeling(labels, Status.CONVERGED, beliefs), fine, cells, layout)
    assert found.labels.tolist() == [1, 2]
    assert found.beliefs is not None
    assert found.beliefs.tolist() == [[0.375, 0.625, 0.0], [0.25, 0.0, 0.75]]


def test_a_map_without_room_for_a_cell_of_the_model_is_refused() -> None:
    cells = np.full((20, 20), 100, np.int8)
    cells[::10] = 0
    with pytest.raises(
        MapError, match=r"no free cell is left .* 0\.005 m to 0\.05 m cells .*; look at"
    ):
        label_map(labeler(), OccupancyGrid(cells, 0.005))


class Heard(Silent):
    """What was warned of, and the stages that had begun by then."""

    def __init__(self) -> None:
        self.stages: list[str] = []
        self.warnings: list[tuple[str, int]] = []

    @contextmanager
    def stage(self, name: str) -> Iterator[Stage]:
        self.stages.append(name)
        yield self

    def warn(self, message: str) -> None:
        self.warnings.append((message, len(self.stages)))


@pytest.mark.parametrize(
    ("resolution_m", "said"),
    [
        (0.5, "from 0.5 m to 0.05 m cells for the model (2,800 free cells); each cell"),
        (0.025, "from 0.025 m to 0.05 m cells for the model (6 free cells); labels are"),
    ],
)
def test_what_becomes_of_the_cells_is_said_before_the_work(resolution_m: float, said: str) -> None:
    cells = np.zeros((5, 8), np.int8)
    cells[3:, 2:] = 100
    heard = Heard()
    found = label_map(labeler(), OccupancyGrid(cells, resolution_m), progress=heard)
    [(message, n_stages)] = heard.warnings
    assert said in message
    assert n_stages == 0
    assert heard.stages
    assert found.warnings == (message,)


def test_a_map_that_would_be_split_into_too_many_cells_is_refused() -> None:
    coarse = OccupancyGrid(np.zeros((1200, 1000), np.int8), 0.5)
    with pytest.raises(MapError) as caught:
        label_map(labeler(), coarse)
    assert str(caught.value) == (
        "the map has cells of 0.5 m, the model needs 0.05 m: its 1,200,000 cells would be "
        "split into 120,000,000, more than 100,000,000; crop the map, use a model of a coarser "
        "resolution, or raise max_cells (label --max-cells), which will take long"
    )
    small = OccupancyGrid(np.zeros((4, 5), np.int8), 0.5)
    with pytest.raises(MapError, match=r"split into 2,000, more than 1,999; crop the map"):
        label_map(labeler(), small, max_cells=1999)
    assert (label_map(labeler(), small, max_cells=2000).labels >= 0).all()


@cache
def space_labeler() -> PlaceLabeler:
    made = [generate_building(seed, size="small", resolution_m=0.1) for seed in (1, 2)]
    methods = {"space": PlaceMethod("independent"), "laser": PlaceMethod("independent", "laser")}
    learner = PlaceLabeler(
        made[0].label_names,
        methods,
        classifier=DecisionListClassifier(n_rounds=10, order="rarest-first"),
        space=SpaceOptions(n_rounds=20),
        max_examples_per_map=600,
        n_folds=2,
    )
    return learner.fit([LabelledMap(item.grid, item.labels) for item in made])


@pytest.mark.parametrize("method", ["space", "laser"])
@pytest.mark.parametrize("resolution_m", [0.05, 0.1, 0.2])
def test_doorways_are_handed_on_where_the_model_knows_spaces(
    method: str, resolution_m: float
) -> None:
    drawn = generate_building(3, size="small", resolution_m=resolution_m)
    found = label_map(space_labeler(), drawn.grid, method=method)
    doorways = found.doorways
    assert doorways is not None
    assert doorways.probability.min() > 0.5
    truth = topological_map(drawn.grid, drawn.labels, drawn.label_names)
    places = topological_map(
        drawn.grid, found.labels, found.label_names, doorways=doorways, correct=False
    )
    np.testing.assert_array_equal(places.region > 0, found.labels >= 0)
    gates = [region for region in places.regions if region.gate is not None]
    assert gates == [region for region in places.regions if region.label == "doorway"]
    assert len(gates) == len(doorways)
    doors = [region for region in truth.regions if region.label == "doorway"]
    assert 2 * sum(any(held(gate, door) for gate in gates) for door in doors) > len(doors)


def test_lean_scores_have_the_same_doorways_in_place_of_spaces() -> None:
    grid = generate_building(3, size="small", resolution_m=0.1).grid
    _, kept = space_labeler().scores(grid, methods=["space"])
    _, found = space_labeler().scores(grid, methods=["space"], lean=True)
    assert found.spaces is None and kept.spaces is not None and found.doorways is not None
    assert np.array_equal(found.doorways.place, kept.spaces.doorways.place)
    assert found.doorways.gates == kept.spaces.doorways.gates
    assert found.space is not None and kept.space is not None
    assert np.array_equal(found.space, kept.space)


def held(gate: Region, door: Region) -> bool:
    """Whether a gate stands where a labelled door is."""
    assert gate.gate is not None
    return bool(gate.gate.contains([door.anchor_m], wider_m=0.3, deeper_m=0.3)[0])


def test_models_that_know_no_spaces_hand_on_no_doorways() -> None:
    without = copy(space_labeler())
    without.unary_model_ = replace(without.unary_model_, space=None)
    grid = generate_building(3, size="small", resolution_m=0.1).grid
    assert label_map(without, grid, method="laser").doorways is None


def test_cells_too_large_for_walls_are_refused_before_they_are_split() -> None:
    """A resolution of 3.15, instead of 0.05 or of cells a metre, took minutes."""
    grid = OccupancyGrid(np.zeros((90, 90), np.int8), 3.15)
    with pytest.raises(MapError, match=r"cells of 3\.15 m, which show neither walls nor doorways"):
        label_map(labeler(), grid)
