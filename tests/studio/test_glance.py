"""What is shown before a map has been labelled."""

import numpy as np

from pgm_places.datasets import generate_building
from pgm_places.progress import Silent
from pgm_places.studio.lesson import Question, Tutor, glance
from pgm_places.teaching.paint import Paint
from pgm_places.trained import trained_labeler

BUILDING = generate_building(4, size="small", resolution_m=0.1)


def test_a_glance_is_mostly_right_and_needs_networks() -> None:
    labels = glance(trained_labeler(), BUILDING.grid)
    assert labels is not None
    assert ((labels >= 0) == BUILDING.grid.free).all()
    known = (BUILDING.labels >= 0) & BUILDING.grid.free
    assert (labels == BUILDING.labels)[known].mean() > 0.8
    assert glance(trained_labeler("generated"), BUILDING.grid) is None
    assert glance(None, BUILDING.grid) is None


def test_a_tutor_glances_once_and_before_it_labels() -> None:
    seen: list[np.ndarray] = []
    tutor = Tutor(BUILDING.grid, trained_labeler(), glanced=seen.append)
    paint = Paint.blank(BUILDING.grid.shape, trained_labeler().label_names_)
    for revision in range(2):
        lesson = tutor.answer(Question(paint, revision, learns=False), Silent())
        assert len(seen) == 1
    assert (seen[0] == lesson.labels)[BUILDING.grid.free].mean() > 0.8
