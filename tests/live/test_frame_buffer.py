"""Frames looked up live are where reading the whole bag would put them."""

import numpy as np
import pytest

from pgm_places.io.logs.bag_poses import KEEP_S, FrameBuffer, FrameTree, PoseTrack, at_times


def moved(seed: int, n: int = 30) -> list[tuple[float, tuple[float, float, float, bool]]]:
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0, 8, n)).tolist()
    return [(t, (*rng.normal(size=2).tolist(), float(rng.uniform(-3, 3)), False)) for t in times]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_chain_of_frames_is_that_of_a_whole_bag(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edges = [("map", "odom"), ("odom", "base_link")]
    entries = {edge: moved(10 * seed + number) for number, edge in enumerate(edges)}
    mount = (0.2, -0.1, 0.4, bool(seed % 2))
    frames = FrameBuffer()
    tracks = {}
    for edge, values in entries.items():
        tracks[edge] = PoseTrack.from_entries((t, *place) for t, place in values)
        for number in rng.permutation(len(values)):  # they need not come in order
            frames.add(f"/{edge[0]}", edge[1], *values[number])
    tracks["base_link", "laser"] = PoseTrack.from_entries([(0.0, *mount)], is_static=True)
    frames.add("base_link", "laser", 0.0, mount, is_static=True)
    chain = FrameTree(tracks).chain("map", "laser")
    assert chain is not None
    first = max(values[0][0] for values in entries.values())
    last = min(values[-1][0] for values in entries.values())
    times = [first, last, *rng.uniform(first, last, 20).tolist(), entries[edges[0]][7][0]]
    wanted, _, mirrored = at_times(chain, np.array(times), "interpolated", np.inf)
    for time, pose in zip(times, wanted, strict=True):
        found = frames.pose("map", "/laser", time)
        assert found.pose is not None
        np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-12)
        assert found.mirrored == mirrored == bool(seed % 2)


def test_no_pose_is_made_up() -> None:
    frames, place = FrameBuffer(), (1.0, 2.0, 0.0, False)
    assert frames.pose("map", "laser", 0.0).problem.endswith("'laser'; frames: none")
    frames.add("map", "laser", 5.0, place)
    frames.add("map", "laser", 6.0, place)
    late = frames.pose("map", "laser", 6.5)
    assert (late.pose, late.may_come) == (None, True)
    assert late.problem == "the transform from map to laser is 0.50 s older than the scan"
    early = frames.pose("map", "laser", 4.0)
    assert (early.pose, early.may_come) == (None, False)
    assert early.problem == "the transforms from map to laser begin 1.00 s after the scan"
    assert "no transforms lead from 'odom' to 'laser'; frames: laser, map" in (
        frames.pose("odom", "laser", 5.5).problem
    )


def test_old_transforms_are_forgotten_and_so_is_the_future_when_the_clock_jumps_back() -> None:
    frames = FrameBuffer()
    for step in range(300):
        frames.add("map", "laser", 0.1 * step, (float(step), 0.0, 0.0, False))
    assert frames.pose("map", "laser", 5.0).pose is None
    assert frames.pose("map", "laser", 29.9 - KEEP_S + 0.2).pose is not None
    frames.add("map", "laser", 1.0, (7.0, 0.0, 0.0, False))
    assert frames.pose("map", "laser", 25.0).pose is None
    found = frames.pose("map", "laser", 1.0).pose
    assert found is not None and found[0] == 7.0


def test_a_frame_that_gets_another_parent_follows_it() -> None:
    frames = FrameBuffer()
    frames.add("odom", "laser", 1.0, (1.0, 0.0, 0.0, False))
    frames.add("map", "laser", 1.0, (2.0, 0.0, 0.0, False), is_static=True)
    found = frames.pose("map", "laser", 9.0).pose
    assert found is not None and found[0] == 2.0
    frames.add("laser", "tip", 5.0, (1.0, 0.0, 0.0, False))
    frames.forget_after(4.0)
    assert frames.pose("map", "laser", 9.0).pose is not None
    assert not frames.knows("tip")
