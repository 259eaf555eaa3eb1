"""The floor networks on the map around a robot, and their word beside the list of scans."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places import OccupancyGrid, TrajectoryLabeler, load, save
from pgm_places.errors import ConfigError, ModelFileError
from pgm_places.floor.architecture import parameters
from pgm_places.floor.network import FloorNetwork
from pgm_places.persistence.labelers import dump_trajectory, load_trajectory
from pgm_places.trained import trained_floor
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.local_features import LocalFloor, square_around, with_local_floor
from pgm_places.unary.scan_model import BeamOptions
from tests.drives import building, drive
from tests.quick_labeler import places


def one_view() -> FloorModel:
    """The first shipped network, from one side."""
    return replace(trained_floor(), networks=trained_floor().networks[:1], views_per_network=1)


def tracker(floor: FloorModel | None = None) -> TrajectoryLabeler:
    return TrajectoryLabeler.from_places(places()).with_options(floor=floor)


def test_networks_see_the_square_around_the_robot() -> None:
    grid, model = building()[0].grid, one_view()
    where = grid.cell_centres_m(np.argwhere(grid.free))[500]
    around = square_around(grid, where, 16.0)
    assert around is not None
    expected = model.evidence(model.scores(around), around.cells_at_m(where[None]))[0]
    np.testing.assert_array_equal(LocalFloor(grid, model).at(where), expected)


def test_they_look_again_after_half_a_metre(monkeypatch: pytest.MonkeyPatch) -> None:
    grid, looks = building()[0].grid, []
    scores = FloorModel.scores

    def counted(self: FloorModel, *given: object) -> object:
        looks.append(1)
        return scores(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(FloorModel, "scores", counted)
    x, y = grid.cell_centres_m(np.argwhere(grid.free)).mean(axis=0)
    poses = np.array([[x + 0.1 * k, y, 0.0] for k in range(12)])
    LocalFloor(grid, one_view()).along(poses)
    assert len(looks) == 3  # after 0, 0.5 and 1 m


def test_networks_take_turns() -> None:
    grid = building()[0].grid
    two = replace(one_view(), networks=trained_floor().networks[:2])
    x, y = grid.cell_centres_m(np.argwhere(grid.free)).mean(axis=0)
    poses = np.array([[x + 0.6 * k, y, 0.0] for k in range(3)])
    found = LocalFloor(grid, two).along(poses)
    for network, steps in ((0, [0, 2]), (1, [1])):
        alone = replace(two, networks=two.networks[network : network + 1])
        expected = np.array([LocalFloor(grid, alone).at(poses[t, :2]) for t in steps])
        np.testing.assert_array_equal(found[steps], expected)


def test_off_the_map_they_see_nothing() -> None:
    grid = OccupancyGrid(np.zeros((20, 20), np.int8), resolution_m=0.1)
    seen = LocalFloor(grid, one_view()).along(np.array([[1.0, 1.0, 0.0], [90.0, 0.0, 0.0]]))
    assert np.isfinite(seen[0]).all() and np.isnan(seen[1]).all()


def test_the_mean_of_log_odds() -> None:
    list_says, networks_say = np.array([[0.2, 0.7, 0.1]]), np.array([[0.6, 0.3, 0.1]])
    model = FloorModel((), share=0.25, doorway_share=0.5)
    found = with_local_floor(np.log(list_says), np.log(networks_say), model)
    product = list_says ** [0.75, 0.75, 0.5] * networks_say ** [0.25, 0.25, 0.5]
    np.testing.assert_allclose(np.exp(found), product / product.sum())


def test_steps_that_networks_do_not_see_keep_the_lists_word() -> None:
    log_z = np.log([[0.2, 0.7, 0.1], [0.3, 0.3, 0.4]])
    seen = np.array([[np.nan] * 3, np.log([0.8, 0.1, 0.1])])
    found = with_local_floor(log_z, seen, FloorModel((), share=0.5, doorway_share=0.5))
    np.testing.assert_array_equal(found[0], log_z[0])
    assert found[1].argmax() == 0


@pytest.mark.parametrize("known", [False, True])
def test_step_by_step_gives_the_beliefs_of_the_whole_log(known: bool) -> None:
    path, known_map = drive(1)[:60], building()[0].grid if known else None
    tool = tracker(one_view()).with_options(
        beams=BeamOptions("known-map" if known else "local-map")
    )
    whole = tool.label(path, known_map=known_map)
    assert path.geometry is not None
    online = tool.online(path.geometry, known_map=known_map)
    beliefs = [online.step(path.scan(t)) for t in range(len(path))]
    np.testing.assert_array_equal(whole.beliefs, np.array(beliefs))
    alone = tool.with_options(floor=None).label(path, known_map=known_map)
    assert whole.beliefs is not None and alone.beliefs is not None
    assert not np.array_equal(whole.beliefs, alone.beliefs)


def test_positions_without_scans_are_seen_in_the_known_map() -> None:
    path, grid = drive(1)[:20], building()[0].grid
    tool = tracker(one_view()).with_options(beams=BeamOptions("known-map"))
    bare = replace(path, ranges_m=None, geometry=None)
    seen = LocalFloor(grid, one_view()).along(path.poses)
    expected = with_local_floor(
        tool.with_options(floor=None).scores(bare, known_map=grid), seen, one_view()
    )
    np.testing.assert_array_equal(tool.scores(bare, known_map=grid), expected)


def test_networks_need_a_map_around_the_robot() -> None:
    with pytest.raises(ConfigError, match="builds no map, but floor networks need one"):
        tracker(one_view()).with_options(beams=BeamOptions("mirror")).check_options()


def test_shipped_networks_are_named_and_others_stored(tmp_path: Path) -> None:
    path = drive(1)[:20]
    shared = tracker(replace(trained_floor(), share=0.3, views_per_network=1))
    manifest, arrays = dump_trajectory(shared)
    assert manifest["floor"]["networks_of"] == "default"
    assert not any(name.startswith("floor") for name in arrays)
    rng = np.random.default_rng(0)
    weights = {
        name: rng.normal(size=shape).astype(np.float32) * 0.05 for name, shape in parameters()
    }
    own = tracker(FloorModel((FloorNetwork.unpacked(FloorNetwork(weights).packed()),)))
    for number, tool in enumerate((shared, own)):
        folder = tmp_path / str(number)
        save(tool, folder)
        found = load(folder)
        np.testing.assert_array_equal(found.scores(path), tool.scores(path))
    manifest["floor"]["networks_of"] = "another"
    with pytest.raises(ModelFileError, match="networks_of must be 'default', got 'another'"):
        load_trajectory(manifest, arrays)
