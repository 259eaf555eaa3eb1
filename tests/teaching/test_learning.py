"""What paint teaches a list: gates of both kinds alike, and corridors that look like halls."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import trained_labeler
from pgm_places.models.boosting_rounds import TeachingExamples
from pgm_places.simulation import generate_building
from pgm_places.teaching import learning
from pgm_places.teaching.interactive_labeler import InteractiveLabeler
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.training_selection import CellSelection, learned_further

NAMES = ("corridor", "room", "doorway")
CORRIDOR, ROOM, HALL, SHOWN = 0, 1, 3, 4


@dataclass(frozen=True)
class StubList:
    """A list that takes each row for a hall by its first column, for a corridor by its second."""

    def log_histogram(self, rows: NDArray[np.float32]) -> NDArray[np.float64]:
        log_z = np.full((len(rows), 5), -10.0)
        log_z[:, HALL], log_z[:, CORRIDOR] = rows[:, 0], rows[:, 1]
        return log_z


def labels_with_halls(labels: list[int]) -> list[int]:
    """What cells are taught as, the list taking every second one for a hall."""
    nodes = np.arange(10, 10 + len(labels))
    selection = CellSelection(nodes, np.array(labels), np.array([0, 1]))
    looks = np.zeros((len(nodes) + 2, 2), np.float32)
    looks[2::2, 0] = 1.0
    looks[3::2, 1] = 1.0
    rows = learning._SelectedRows(selection, looks)
    fitted: Any = StubList()
    return rows.with_halls(fitted, HALL, SHOWN, CORRIDOR).selection.labels.tolist()


@pytest.mark.parametrize(
    ("painted", "taught"),
    [
        ([CORRIDOR, CORRIDOR, ROOM, CORRIDOR], [HALL, CORRIDOR, ROOM, CORRIDOR]),
        ([CORRIDOR, CORRIDOR, SHOWN], [CORRIDOR, CORRIDOR, HALL]),  # halls are painted themselves
        ([ROOM, HALL], [ROOM, HALL + 1]),  # a new class
    ],
)
def test_painted_corridors_that_look_like_halls_are_taught_as_halls(
    painted: list[int], taught: list[int]
) -> None:
    assert labels_with_halls(painted) == taught


def test_gates_of_both_kinds_weigh_the_same_together(monkeypatch: pytest.MonkeyPatch) -> None:
    building = generate_building(4, size="small", resolution_m=0.1)
    teacher = InteractiveLabeler(building.grid, trained_labeler("generated"))
    taught: list[TeachingExamples] = []

    def watched(fitted: Any, examples: TeachingExamples, *more: Any) -> Any:
        taught.append(examples)
        return learned_further(fitted, examples, *more)

    monkeypatch.setattr(learning, "learned_further", watched)
    paint = Paint.blank(building.grid.shape, NAMES)
    for label, name in enumerate(NAMES):
        paint = paint.with_cells(np.argwhere(building.labels == label), name)
    teacher.teach(paint)
    gates = taught[0]
    counts = np.bincount(gates.labels, minlength=2)
    assert counts.min() > 0 and counts[0] != counts[1]
    for label in (0, 1):
        of_label = gates.weights[gates.labels == label]
        assert of_label.sum() == pytest.approx(1.0) and np.ptp(of_label) == 0
