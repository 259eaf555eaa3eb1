"""Pieces of floors for training: altered, but never against their labels."""

import numpy as np
import pytest

pytest.importorskip("cv2", reason="pieces of floors are cut with OpenCV")

import cv2

from pgm_places.training.crops import N_TARGETS, SIDE, LabelledFloor, batch, crop


def floor(*, drawn: bool = True) -> LabelledFloor:
    """A corridor between rooms of 5 x 5 m, with doors."""
    free = np.zeros((200, 400), np.uint8)
    labels = np.zeros_like(free)
    free[90:112, 5:395], labels[90:112, 5:395] = 255, 1
    for left in range(10, 380, 55):
        for rows, door in ((slice(35, 87), slice(87, 90)), (slice(115, 165), slice(112, 115))):
            free[rows, left : left + 50], labels[rows, left : left + 50] = 255, 2
            free[door, left + 20 : left + 29], labels[door, left + 20 : left + 29] = 255, 3
    near = np.zeros(free.shape, np.bool_)
    near[1:-1, 1:-1] = (
        (free[2:, 1:-1] | free[:-2, 1:-1] | free[1:-1, 2:] | free[1:-1, :-2]) > 0
    ) & (free[1:-1, 1:-1] == 0)
    return LabelledFloor.of(free, near.astype(np.uint8) * 255, labels, drawn=drawn)


def test_a_seed_gives_the_same_piece() -> None:
    one, two = (crop(floor(), np.random.default_rng(4)) for _ in range(2))
    for mine, theirs in zip(one, two, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    other = crop(floor(), np.random.default_rng(5))
    assert (one[0] != other[0]).any()


@pytest.mark.parametrize("seed", range(12))
def test_labels_are_of_free_cells(seed: int) -> None:
    x, y = crop(floor(), np.random.default_rng(seed))
    assert x.shape == (SIDE // 2, SIDE // 2, 10)
    assert y.shape == (SIDE // 2, SIDE // 2, N_TARGETS)
    assert np.isfinite(x).all()
    labelled = y.sum(axis=2)
    assert labelled.max() <= 1
    assert y[..., 3:].sum() == 0  # there are no halls here
    some_free = (x[..., :4] > 0).any(axis=2)
    assert (labelled[~some_free] == 0).all()


def test_most_cells_keep_the_label_of_their_shape() -> None:
    sums = sum(crop(floor(), np.random.default_rng(seed))[1].sum((0, 1)) for seed in range(30))
    assert sums[1] > sums[0] > sums[2] > 0


def test_a_piece_that_is_bent_is_bent_along_both_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    remap = cv2.remap

    def noted(values: np.ndarray, at_x: np.ndarray, at_y: np.ndarray, how: int) -> np.ndarray:
        seen.append((at_x, at_y))
        return np.asarray(remap(values, at_x, at_y, how))

    monkeypatch.setattr(cv2, "remap", noted)
    for seed in range(12):
        crop(floor(), np.random.default_rng(seed))
    y, x = np.mgrid[:SIDE, :SIDE]
    plane = np.stack([np.ones(x.size), x.ravel(), y.ravel()], axis=1)
    bent = []
    for maps in seen[::3]:  # each piece is of three rasters
        rests = [np.linalg.lstsq(plane, along.ravel(), rcond=None)[1][0] for along in maps]
        bent.append([rest > 1.0 for rest in rests])
    assert {tuple(axes) for axes in bent} == {(False, False), (True, True)}


def test_a_batch_draws_from_every_source() -> None:
    rng = np.random.default_rng(1)
    one = np.ones(1)
    x, y = batch([[floor()], [floor(drawn=False)]], [0.5, 0.5], [one, one], 3, rng)
    assert len(x) == len(y) == 3
    assert (y.sum((1, 2, 3)) >= 100).all()
