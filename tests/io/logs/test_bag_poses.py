"""Poses over time: interpolation, gaps, and trees of frames."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.io.logs.bag_poses import FrameTree, PoseTrack, at_times, planar

TRACK = PoseTrack.from_entries(
    [(0.0, 0.0, 0.0, 3.0, False), (1.0, 2.0, 4.0, -3.0, False), (5.0, 2.0, 4.0, 0.0, False)]
)


def fixed(x: float, y: float, heading: float, *, mirrored: bool = False) -> PoseTrack:
    return PoseTrack.from_entries([(0.0, x, y, heading, mirrored)], is_static=True)


def test_poses_between_entries_and_at_them() -> None:
    poses, known = TRACK.at(np.array([0.5]), "interpolated", 1.0)  # headings the short way
    np.testing.assert_allclose(np.abs(poses), [[1.0, 2.0, np.pi]], rtol=0, atol=1e-12)
    assert known.tolist() == [True]
    poses, known = TRACK.at(TRACK.times_s, "interpolated", 0.0)
    assert known.all() and (poses == TRACK.poses).all()
    poses, _ = TRACK.at(np.array([0.4, 0.6, 9.0, -9.0]), "nearest", 100.0)
    assert poses[:, 2].tolist() == [3.0, -3.0, 0.0, 3.0]
    track = PoseTrack.from_entries([(2.0, 1, 0, 0, False), (1.0, 0, 0, 0, False)] * 2)
    assert track.times_s.tolist() == [1.0, 2.0]
    assert not PoseTrack.from_entries([]).at(np.zeros(2), "interpolated", 1.0)[1].any()


@pytest.mark.parametrize(
    ("lookup", "gap", "known"),
    [
        ("interpolated", 1.0, [0, 1, 1, 1, 0, 1, 0]),
        ("interpolated", 4.0, [0, 1, 1, 1, 1, 1, 0]),
        ("nearest", 0.25, [0, 1, 1, 1, 0, 1, 0]),
        ("nearest", 1.0, [1, 1, 1, 1, 1, 1, 1]),
    ],
)
def test_only_poses_that_are_close_enough_count(lookup: str, gap: float, known: list[int]) -> None:
    times = np.array([-0.5, 0.0, 0.25, 1.0, 2.0, 5.0, 5.5])
    assert TRACK.at(times, lookup, gap)[1].tolist() == known  # type: ignore[arg-type]


@given(
    a=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3)),
    b=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3)),
    upside_down=st.booleans(),
)
def test_a_chain_multiplies_the_matrices(
    a: tuple[float, float, float], b: tuple[float, float, float], upside_down: bool
) -> None:
    def matrix(pose: tuple[float, float, float], mirrored: bool) -> np.ndarray:
        cos, sin, side = np.cos(pose[2]), np.sin(pose[2]), -1 if mirrored else 1
        return np.array([[cos, -sin * side, pose[0]], [sin, cos * side, pose[1]], [0, 0, 1]])

    chain = [fixed(*a, mirrored=upside_down), fixed(*b, mirrored=True)]
    poses, known, mirrored = at_times(chain, np.zeros(1), "interpolated", 1.0)
    wanted = matrix(a, upside_down) @ matrix(b, True)
    found = matrix(tuple(poses[0]), mirrored)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)
    assert known.all()


@pytest.mark.parametrize("far", [1.1e7, 1e308, -np.inf, np.nan])
def test_a_place_that_no_robot_has_is_no_pose(far: float) -> None:
    poses, known, _ = at_times([fixed(far, 0, 0), fixed(far, 0, 0)], np.zeros(2), "nearest", 1.0)
    assert not known.any()
    assert not poses.any()


def test_a_chain_leads_from_an_ancestor_down() -> None:
    one, two = fixed(1, 0, 0), fixed(2, 0, 0)
    tree = FrameTree({("map", "odom"): one, ("odom", "laser"): two})
    assert tree.chain("map", "laser") == [one, two]
    assert tree.chain("laser", "laser") == []
    assert tree.chain("laser", "map") is tree.chain("moon", "laser") is None
    assert tree.frames == ["laser", "map", "odom"]
    assert FrameTree({("a", "b"): one, ("b", "a"): two}).chain("map", "a") is None


@given(heading=st.floats(-3.1, 3.1), flipped=st.booleans(), scale=st.floats(0.5, 2.0))
def test_quaternions_seen_from_above(heading: float, flipped: bool, scale: float) -> None:
    cos, sin = scale * np.cos(heading / 2), scale * np.sin(heading / 2)
    # Turned about the z axis, and where it is flipped, about the new x axis by half a turn.
    quaternion = (cos, sin, 0.0, 0.0) if flipped else (0.0, 0.0, sin, cos)
    x, y, found, mirrored = planar(
        SimpleNamespace(x=1.0, y=2.0, z=3.0),
        SimpleNamespace(**dict(zip("xyzw", quaternion, strict=True))),
    )
    assert (x, y, mirrored) == (1.0, 2.0, flipped)
    np.testing.assert_allclose(found, heading, rtol=0, atol=1e-9)
