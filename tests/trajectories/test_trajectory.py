"""Trajectories: checks, parts, frames, labels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import LabelledMap, OccupancyGrid, Scan, ScanGeometry, Similarity, Trajectory
from pgm_places.errors import InputError, LabelError
from pgm_places.trajectories.path import headings_along
from tests.refusals import refused

GEOMETRY = ScanGeometry.half_circle(4, range_max_m=8.0)


def trajectory(n_steps: int = 5) -> Trajectory:
    rng = np.random.default_rng(3)
    return Trajectory(
        np.arange(n_steps, dtype=np.float64),
        np.column_stack([np.arange(n_steps), np.zeros(n_steps), np.zeros(n_steps)]),
        rng.uniform(0, 8, (n_steps, 4)).astype(np.float32),
        GEOMETRY,
        np.arange(n_steps) % 3 - 1,
        ("room", "corridor"),
        rng.normal(size=(n_steps, 3)),
        "walk",
    )


def test_it_knows_its_length_and_says_what_it_is() -> None:
    path = trajectory()
    assert len(path) == 5
    assert path.path_length_m == 4.0
    assert path.graph().is_chain and path.graph().n_nodes == 5
    disordered = Trajectory(np.array([0.0, 2.0, 1.0, 3.0, 2.5]), np.zeros((5, 3)))
    assert disordered.n_backward_times == 2
    assert disordered.times_s.tolist() == [0.0, 2.0, 1.0, 3.0, 2.5]
    assert repr(path) == "Trajectory('walk', 5 steps, 4 m, 4 beams, labels room, corridor)"


def test_its_arrays_are_read_only_copies() -> None:
    times = np.zeros(2)
    path = Trajectory(times, np.zeros((2, 3)))
    times[0] = 7
    assert path.times_s[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        path.poses[0, 0] = 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"poses": np.zeros((4, 3))}, "poses must have shape (5, 3), got (4, 3)"),
        ({"poses": np.full((5, 3), np.nan)}, "poses must hold finite numbers"),
        ({"ranges_m": None}, "ranges_m and geometry belong together"),
        ({"ranges_m": np.zeros((5, 3))}, "ranges_m must have shape (5, 4), got (5, 3)"),
        ({"ranges_m": np.full((5, 4), np.inf)}, "ranges_m must hold finite numbers"),
        ({"ranges_m": np.full((5, 4), 9.0)}, "must lie from 0 to range_max_m = 8 m, got 9 to 9"),
        ({"ranges_m": np.full((5, 4), -1.0)}, "geometry.cleaned(readings) makes them so"),
        ({"labels": None}, "labels and label_names belong together"),
        ({"labels": np.full(5, 2)}, "labels must hold integers from -1 to 1, got 2"),
        ({"odometry": np.zeros((5, 2))}, "odometry must have shape (5, 3)"),
    ],
)
def test_fields_that_do_not_fit_are_refused(change: dict[str, object], message: str) -> None:
    path = trajectory()
    fields = {name: getattr(path, name) for name in path.__dataclass_fields__}
    with pytest.raises(InputError) as caught:
        Trajectory(**{**fields, **change})
    assert message in str(caught.value)


@given(data=st.data())
def test_a_subset_takes_every_field_along(data: st.DataObject) -> None:
    path = trajectory()
    steps = np.array(data.draw(st.lists(st.integers(0, 4), max_size=6)), np.int64)
    part = path.subset(steps)
    assert len(part) == len(steps)
    for name in ("times_s", "poses", "ranges_m", "labels", "odometry"):
        assert (getattr(part, name) == getattr(path, name)[steps]).all()
    assert (part.geometry, part.label_names, part.name) == (GEOMETRY, path.label_names, "walk")


def test_slices_masks_and_numbers_choose_the_same_steps() -> None:
    path = trajectory()
    wanted = path[1:3].times_s.tolist()
    assert path.subset(np.array([False, True, True, False, False])).times_s.tolist() == wanted
    assert path.subset([1, 2]).times_s.tolist() == wanted
    assert len(path.subset([])) == 0
    with pytest.raises(InputError, match=r"a mask must have shape \(5,\), got \(3,\)"):
        path.subset(np.ones(3, np.bool_))
    refused(InputError, "integers from 0 to 4, got 5", path.subset, [5])


def test_scans_make_the_trajectory_they_came_from() -> None:
    path = trajectory()
    again = Trajectory.from_scans((path.scan(step) for step in range(len(path))), name="walk")
    for field in ("times_s", "poses", "ranges_m", "odometry"):
        assert (getattr(again, field) == getattr(path, field)).all()


def test_scans_of_different_sensors_make_no_trajectory() -> None:
    other = ScanGeometry.half_circle(4, range_max_m=9.0)
    scans = [Scan(0.0, np.zeros(3), np.ones(4, np.float32), kind) for kind in (GEOMETRY, other)]
    with pytest.raises(InputError, match=r"scan 1 has .*0 to 9 m.* but the first one .*0 to 8 m"):
        Trajectory.from_scans(scans)
    refused(InputError, "no scan", Trajectory.from_scans, [])
    refused(InputError, "has no scans", Trajectory(np.zeros(1), np.zeros((1, 3))).scan, 0)


def test_a_similarity_moves_poses_and_stretches_scans() -> None:
    ranges = np.array([[1.0, 2.0, 8.0, 0.5]], np.float32)
    path = Trajectory(np.zeros(1), np.array([[1.0, 0.0, 0.5]]), ranges, GEOMETRY)
    moved = path.transformed(Similarity(np.pi / 2, (10.0, 0.0), 2.0))
    np.testing.assert_allclose(moved.poses, [[10.0, 2.0, 0.5 + np.pi / 2]], rtol=0, atol=1e-12)
    assert moved.ranges_m is not None and moved.geometry is not None
    assert moved.ranges_m.tolist() == [[2.0, 4.0, 16.0, 1.0]]
    assert moved.geometry.returned(moved.ranges_m).tolist() == [[True, True, False, True]]


def test_a_map_gives_its_labels_to_the_steps_on_it() -> None:
    grid = OccupancyGrid(np.zeros((1, 4), np.int8), resolution_m=1.0)
    window = np.array([[True, True, False, True]])
    labelled = LabelledMap(grid, np.array([[0, 1, 1, -1]], np.int16), window)
    x = np.array([0.5, 1.5, 2.5, 3.5, 4.5, -0.5])
    path = Trajectory(np.arange(6.0), np.column_stack([x, np.full(6, 0.5), np.zeros(6)]))
    found = path.labelled_by(labelled, ("room", "corridor"))
    assert found.labels is not None
    assert found.labels.tolist() == [0, 1, -1, -1, -1, -1]
    with pytest.raises(LabelError, match="label index 1 but there are only 1 labels: room"):
        path.labelled_by(labelled, ["room"])


@given(heading=st.floats(-3, 3), n_steps=st.integers(2, 6))
def test_headings_follow_a_straight_path(heading: float, n_steps: int) -> None:
    way = np.arange(n_steps)[:, None] * [np.cos(heading), np.sin(heading)]
    np.testing.assert_allclose(headings_along(way), heading, rtol=0, atol=1e-9)


def test_standing_robots_keep_their_heading() -> None:
    path = [[0, 0], [0, 0], [0, 0], [0, 1], [0, 1], [0, 1]]
    np.testing.assert_allclose(headings_along(path), np.pi / 2, rtol=0, atol=1e-12)
    assert headings_along([[3, 3], [3, 3]]).tolist() == [0, 0]


def test_labels_may_be_merged_and_left_out() -> None:
    path = trajectory().relabelled({"room": "place", "corridor": "place"}, ["door", "place"])
    assert path.labels is not None
    assert path.labels.tolist() == [-1, 1, 1, -1, 1]
    with pytest.raises(LabelError, match="'attic' is not among the labels: room"):
        path.relabelled({"place": "attic"}, ["room"])
    with pytest.raises(LabelError, match="has no labels"):
        Trajectory(np.zeros(1), np.zeros((1, 3))).relabelled({}, [])


def test_a_shorter_reach_reads_nothing_seen_beyond_it() -> None:
    near = trajectory().within(2.0)
    assert near.ranges_m is not None and near.geometry is not None
    far = trajectory().ranges_m
    assert far is not None
    assert (near.geometry.returned(near.ranges_m) == (far < 2)).all()
    refused(InputError, "reach 8 m, they cannot be cut at 9 m", trajectory().within, 9.0)


def test_a_path_is_not_resampled_to_more_steps_than_fit() -> None:
    path = Trajectory(np.arange(2.0), np.array([[-9e6, 0, 0], [9e6, 0, 0]]))
    refused(InputError, "leave out poses that lie far away", path.resampled, 1e-3)
