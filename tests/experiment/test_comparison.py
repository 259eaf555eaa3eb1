"""Confidence intervals of a comparison draw squares of all its maps."""

from dataclasses import replace

import numpy as np
import pytest

from pgm_places.evaluation.bootstrap import block_bootstrap
from pgm_places.experiment.comparison import history_of, learning_of, score_intervals
from pgm_places.experiment.evaluated_items import BLOCK_M
from pgm_places.inference.backends import build
from pgm_places.inference.labeling import Labeling, Status
from tests.report.comparisons import labeling_of, small_map


def test_squares_of_two_maps_are_never_one_block() -> None:
    maps = [small_map("a"), small_map("b")]
    labelings = [labeling_of(item, beliefs=False) for item in maps]
    found = score_intervals(maps, [labelings], 3)
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
    found = score_intervals([item], [[right]], 3)["accuracy"]
    assert (found.low, found.high) == pytest.approx((1.0, 1.0))


def test_histories_are_lines_of_numbers_by_quantity() -> None:
    def told(**info: object) -> dict[str, object]:
        return dict(history_of(Labeling(np.zeros(1, np.int64), Status.CONVERGED, info=info)))

    assert told() == {}
    assert told(history={"change": (0.5, 0.1), "labels": ["a"], "empty": []}) == {
        "change": [0.5, 0.1]
    }
    assert told(history=(1.0, 3.0), decoder="graph-cut") == {"score": [1.0, 3.0]}
    assert told(history=(9.0, 8.0), score_history=(1.0, 2.0), decoder="trw-s") == {
        "bound": [9.0, 8.0],
        "score": [1.0, 2.0],
    }
    assert told(history=(4.0, 0.0), decoder="mean-field") == {"change": [4.0, 0.0]}


def test_learning_tells_objective_and_bound_where_there_are_steps() -> None:
    network = build("amn")
    assert learning_of(network) == {}
    steps = np.array([[0.1, 5.0, 1.0, 1.0], [0.2, 4.0, 3.5, 2.0]])
    found = learning_of(replace(network, learning_history=steps))
    assert found == {"objective": [5.0, 4.0], "lower bound": [1.0, 3.5]}
    assert learning_of(build("relaxation")) == {}
