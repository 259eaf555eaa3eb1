from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from sklearn.base import clone

from pgm_places.errors import ConfigError, InputError, NotFittedError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.labelers.joint_graph import JointGraph
from pgm_places.labelers.joint_labeler import LINK_WEIGHTS, JointLabeler
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.label import label_map, label_map_and_drive
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.persistence.stored import load, save
from pgm_places.sensing.sensor import Sensor
from pgm_places.trajectories.trajectory import MappedDrive
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.scan_model import BeamOptions
from tests.drives import building, drive
from tests.labelers.test_contract import NAMES, QUICK, SENSOR, known, walk
from tests.refusals import refused


def unfitted(method: str = "potts", link_weight: object = "fitted") -> JointLabeler:
    places = PlaceLabeler(NAMES, sensor=SENSOR, classifier=QUICK, space=None, n_folds=2)
    steps = TrajectoryLabeler(
        NAMES, "independent", 0.3, BeamOptions("known-map"), SENSOR, QUICK, n_folds=2
    )
    return JointLabeler(NAMES, method, link_weight, places, steps)  # type: ignore[arg-type]


@lru_cache
def fitted(method: str = "potts") -> JointLabeler:
    return unfitted(method).fit([MappedDrive(known(0), walk(0))], [known(1)])


@pytest.mark.parametrize("method", ["independent", "relaxation", "potts", "amn"])
def test_every_method_labels_a_map_a_drive_and_both(method: str) -> None:
    labeler, grid, drive = fitted(method), known(2).grid, walk(2)
    both = labeler.label(grid, drive)
    assert both.cells is not None and both.steps is not None
    truth = known(2).truth(known(2).graph())
    assert (both.cells.labels == truth)[truth >= 0].mean() > 0.8
    assert (both.steps.labels == drive.labels).mean() > 0.8
    alone = labeler.label(grid)
    assert alone.steps is None and alone.cells is not None
    assert len(alone.cells.labels) == len(both.cells.labels)
    scored = replace(labeler.scores(grid, drive).graph, cells=None)
    assert scored.segments is not None


def test_cells_are_scored_with_gates_and_whole_spaces_as_for_a_map_alone() -> None:
    labeler, grid = _with_spaces(), building()[0].grid
    map_alone = labeler.of_maps()
    found = labeler.scores(grid).cells
    assert found is not None
    np.testing.assert_array_equal(found, map_alone.problem(grid).unary)
    _, before = map_alone.scores(grid)
    assert not np.array_equal(found, before.of("space"))  # gates and whole spaces do change some
    both = labeler.label(grid)
    assert both.cells is not None
    np.testing.assert_array_equal(both.cells.labels, map_alone.label(grid).labels)


def test_places_of_a_map_and_a_drive_end_at_the_gates_of_the_map() -> None:
    labeler, grid = _with_spaces(), building()[0].grid
    found = label_map_and_drive(labeler, grid, drive(1)).map
    alone = label_map(labeler.of_maps(), grid)
    assert found.doorways is not None and alone.doorways is not None
    assert found.doorways.gates == alone.doorways.gates and len(alone.doorways)


@lru_cache
def _with_spaces() -> JointLabeler:
    item, names = building()
    sensor = Sensor(max_range_m=12.0)
    places = PlaceLabeler(
        names,
        sensor=sensor,
        classifier=QUICK,
        space=SpaceOptions(n_rounds=5),
        unary="space",
        doorway_depth_m=0.8,
        n_folds=2,
    )
    steps = TrajectoryLabeler(names, "independent", 0.3, sensor=sensor, classifier=QUICK, n_folds=2)
    labeler = JointLabeler(names, "potts", 4.0, places, steps)
    return labeler.fit([MappedDrive(item, drive(0))])


def test_steps_pull_the_cells_below_them_and_cells_the_steps() -> None:
    """Evidence at one end of a link moves the other end, as it does not without links."""
    grid = OccupancyGrid(np.zeros((3, 8), np.int8), 1.0)
    cells = LabelGraph.from_grid(grid)
    drive = walk(0)[:3]
    drive = replace(drive, poses=np.array([[0.5, 1.5, 0], [3.5, 1.5, 0], [7.5, 1.5, 0]]))
    graph = JointGraph.of(cells, grid, drive, every_m=0.0)
    assert graph.graph.edge_kind is not None
    links = graph.graph.edges[graph.graph.edge_kind == EdgeKind.LINK]
    assert links.tolist() == [[8, 24], [11, 25], [15, 26]]
    unsure, sure = np.log(np.full((24, 2), 0.5)), np.log([[0.1, 0.9]] * 3)
    problem = graph.problem(NAMES, unsure, sure, link_weight=2.0)
    assert problem.edge_features is not None
    np.testing.assert_array_equal(
        problem.edge_features[:, 0], np.where(graph.graph.edge_kind == EdgeKind.LINK, 2.0, 1.0)
    )
    method = fitted().method_
    assert method.infer(problem).labels.tolist() == [1] * 27


def test_segments_pass_their_labels_to_all_of_their_steps() -> None:
    drive = walk(0)
    graph = JointGraph.of(None, None, drive, every_m=1.0)
    assert graph.segments is not None and graph.n_cells == 0
    labels = np.arange(len(graph.segments)) % 2
    found = graph.split(Labeling(labels, Status.CONVERGED))
    assert found.cells is None and found.steps is not None
    np.testing.assert_array_equal(found.steps.labels, labels[graph.segments.of_step])


def test_truth_of_the_cells_comes_before_that_of_the_segments() -> None:
    cells = known(0).graph()
    graph, of_cells = (
        JointGraph.of(cells, known(0).grid, walk(0), every_m=0.0),
        known(0).truth(cells),
    )
    truth = graph.truth(of_cells, walk(0).labels, 2)
    np.testing.assert_array_equal(truth, np.concatenate([of_cells, walk(0).labels]))


def test_the_weight_of_links_is_fitted_or_taken() -> None:
    assert fitted().link_weight_ in LINK_WEIGHTS
    told = unfitted(link_weight=3.0).fit([MappedDrive(known(0), walk(0))])
    assert told.link_weight_ == 3.0
    assert fitted("amn").link_weight_ is None
    weights = fitted("amn").method_.edge_features
    assert weights == ("constant", "kind")


def test_saved_and_loaded_it_labels_the_same(tmp_path: Path) -> None:
    labeler = fitted("amn")
    again = load(save(labeler, tmp_path / "model"))
    assert isinstance(again, JointLabeler)
    before, after = (item.label(known(2).grid, walk(2)).whole.labels for item in (labeler, again))
    np.testing.assert_array_equal(before, after)
    refused(NotFittedError, r"call fit\(drives\) first", clone(again).label, known(2).grid)


def test_what_cannot_be_labelled_together_is_refused_in_a_line() -> None:
    with pytest.raises(ConfigError, match="labels only chains"):
        unfitted("hmm").fit([MappedDrive(known(0), walk(0))])
    refused(InputError, "needs at least one labelled drive", unfitted().fit, [], [known(0)])
    refused(InputError, "give a map, a drive, or both; got neither", fitted().label)
    far = replace(walk(0), poses=walk(0).poses + np.array([500.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="none of its positions is on a labelled cell of the map"):
        fitted().label(known(0).grid, far)
    others = unfitted().set_params(places=PlaceLabeler(("a", "b")))
    with pytest.raises(ConfigError, match="places must have the labels corridor, room, got a, b"):
        others.fit([MappedDrive(known(0), walk(0))])
