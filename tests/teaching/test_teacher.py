"""The teacher: labels that follow the paint."""

from functools import cache

import numpy as np
import pytest

from pgm_places.datasets import LabelledBuilding, generate_building
from pgm_places.errors import LabelError
from pgm_places.labelers.label_map import label_map
from pgm_places.teaching.teacher import Teacher
from pgm_places.trained import trained_labeler

NAMES = ("corridor", "room", "doorway")


@cache
def building() -> LabelledBuilding:
    return generate_building(4, size="small", resolution_m=0.1)


def test_without_paint_it_labels_as_the_labeler_does() -> None:
    teacher = Teacher(building().grid, trained_labeler())
    taught = teacher.label(teacher.blank())
    plain = label_map(trained_labeler(), building().grid)
    np.testing.assert_array_equal(taught.labels, plain.labels)
    alone = label_map(trained_labeler(), building().grid, method="adaboost")
    np.testing.assert_array_equal(taught.unary_labels, alone.labels)
    assert taught.probabilities is not None and taught.unary_probabilities is not None
    free = building().grid.free
    np.testing.assert_allclose(taught.probabilities[free].sum(axis=1), 1, rtol=0, atol=1e-5)
    assert len(taught.gates) == len(plain.doorways or ())
    assert taught.checks and taught.seconds > 0


def test_painted_cells_keep_their_labels_and_ids_stay() -> None:
    teacher = Teacher(building().grid, trained_labeler())
    first = teacher.label(teacher.blank())
    place = max(first.topology.regions, key=lambda region: region.area_m2)
    other = "room" if place.label == "corridor" else "corridor"
    paint = first.paint.with_cells(first.topology.cells(place.id)[::5], other)
    second = teacher.label(paint)
    assert (second.labels[paint.painted] == NAMES.index(other)).all()
    unchanged = {r.id: r.label for r in first.topology.regions if r.label == "doorway"}
    assert unchanged.items() <= {r.id: r.label for r in second.topology.regions}.items()


def test_learning_from_nothing_but_paint() -> None:
    truth, grid = building().labels, building().grid
    teacher = Teacher(grid, classes=NAMES)
    with pytest.raises(LabelError, match="at least two classes, painted are: none"):
        teacher.label(teacher.blank())
    few = np.random.default_rng(0).random(grid.shape) < 0.02
    paint = teacher.blank()
    for label, name in enumerate(NAMES):
        paint = paint.with_mask(few & grid.free & (truth == label), name)
    taught = teacher.teach(paint)
    right = taught.labels == truth
    assert right[grid.free & (truth >= 0)].mean() > 0.9
    assert right[paint.painted].all()


def test_classes_must_hold_those_of_the_labeler() -> None:
    with pytest.raises(LabelError, match="'doorway' is a label of the labeler and must be among"):
        Teacher(building().grid, trained_labeler(), classes=NAMES[:2])
    with pytest.raises(LabelError, match="without a labeler, 'classes' must say"):
        Teacher(building().grid)
