"""Confidence intervals of a comparison draw squares of all its maps."""

from dataclasses import replace

import numpy as np
import pytest

from pgm_places.comparison import BLOCK_M, score_intervals
from pgm_places.evaluation import block_bootstrap
from pgm_places.labeling import Labeling, Status
from tests.report.comparisons import labeling_of, small_map


def test_squares_of_two_maps_are_never_one_block() -> None:
    maps = [small_map("a"), small_map("b")]
    labelings = [labeling_of(item, beliefs=False) for item in maps]
    found = score_intervals(maps, labelings, 3)
    truth, labels, blocks = [], [], []
    for number, (item, labeling) in enumerate(zip(maps, labelings, strict=True)):
        tile = item.layout.cells_rc // round(BLOCK_M / item.grid.resolution_m)
        truth.append(item.layout.from_raster(item.truth))
        labels.append(labeling.labels)
        blocks.append(1000 * number + 10 * tile[:, 0] + tile[:, 1])
    wanted = block_bootstrap(*map(np.concatenate, (truth, labels, blocks)), n_labels=3)
    assert found == wanted
    assert found["accuracy"].low < found["accuracy"].estimate < found["accuracy"].high


def test_right_answers_everywhere_leave_no_doubt() -> None:
    item = replace(small_map(), truth=np.zeros((6, 9), np.int16))
    right = Labeling(np.zeros(len(item.layout.cells_rc), np.int64), Status.CONVERGED)
    found = score_intervals([item], [right], 3)["accuracy"]
    assert (found.low, found.high) == pytest.approx((1.0, 1.0))
