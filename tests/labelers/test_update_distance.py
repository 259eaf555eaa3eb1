"""The distance between updates, chosen on parts of drives that are held out."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.labelers.trajectory_learning import ObservedDrive, WithDistance, chosen_distance
from pgm_places.trajectories.path import PathSegments


def drive(seed: int) -> ObservedDrive:
    rng = np.random.default_rng(seed)
    labels = np.repeat(rng.permutation([0, 1, 0, 1]), 30)
    poses = np.column_stack([0.05 * np.arange(120), np.zeros((120, 2))])
    right = np.where(rng.random(120) < 0.8, labels, 1 - labels)
    return ObservedDrive(poses, np.log(np.where(right[:, None] == [0, 1], 0.8, 0.2)), labels)


def chosen(drives: list[ObservedDrive], right_at: float, seen: list[Any] | None = None) -> Any:
    """A method that knows the truth at one distance, and says 0 at others."""

    def learn(every_m: float, some: Sequence[ObservedDrive]) -> Any:
        if seen is not None:
            seen.append((every_m, [item.poses[:, 0].tolist() for item in some]))
        return every_m

    def label(
        every_m: float, segments: PathSegments, scores: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        best = segments.majority(scores.argmax(axis=1), 2)
        return best if every_m == right_at else np.zeros(len(segments), np.int64)

    return chosen_distance(drives, learn, label)


@pytest.mark.parametrize("every_m", [0.1, 0.2, 0.35])
def test_the_distance_with_the_best_held_out_labels_is_taken(every_m: float) -> None:
    found = chosen([drive(0), drive(1), drive(2)], every_m)
    assert found.every_m == every_m
    assert found.words.startswith(f"{every_m:g} (")
    assert all(f"{tried:g} m" in found.words for tried in (0.1, 0.2, 0.35))


def test_of_equal_ones_the_shortest_is_taken() -> None:
    assert chosen([drive(0)], 5.0).every_m == 0.1


def test_whole_drives_are_held_out_or_parts_of_fewer() -> None:
    seen: list[Any] = []
    chosen([drive(0), drive(1), drive(2), drive(3)], 0.1, seen)
    assert len(seen) == 3 * 4
    assert {len(some) for _, some in seen} == {3}
    seen.clear()
    chosen([drive(0), drive(1)], 0.1, seen)
    assert len(seen) == 3 * 3
    of_first = [x for _, parts in seen[:3] for steps in parts[::2] for x in steps]
    assert sorted(of_first) == sorted(2 * drive(0).poses[:, 0].tolist())


def test_a_given_distance_is_used_as_it_is() -> None:
    class Labeler(WithDistance):
        every_m = 0.7
        chosen_distance_ = chosen([drive(0), drive(1), drive(2)], 0.35)

    given, auto = Labeler(), Labeler()
    auto.every_m = "auto"  # type: ignore[assignment]
    assert (given.update_m, given.method_choices) == (0.7, {})
    assert auto.update_m == 0.35 and "every_m" in auto.method_choices
    auto.chosen_distance_ = None
    assert auto.update_m == 0.1
