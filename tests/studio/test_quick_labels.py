"""What is shown before a map has been labelled."""

import numpy as np

from pgm_places.progress import Silent
from pgm_places.simulation import generate_building
from pgm_places.studio.relabelling import Relabeller, RelabelRequest, quick_labels
from pgm_places.teaching.paint import Paint
from pgm_places.trained import trained_labeler

BUILDING = generate_building(4, size="small", resolution_m=0.1)


def test_a_glance_is_mostly_right_and_needs_networks() -> None:
    labels = quick_labels(trained_labeler(), BUILDING.grid)
    assert labels is not None
    assert ((labels >= 0) == BUILDING.grid.free).all()
    known = (BUILDING.labels >= 0) & BUILDING.grid.free
    assert (labels == BUILDING.labels)[known].mean() > 0.8
    assert quick_labels(trained_labeler("generated"), BUILDING.grid) is None
    assert quick_labels(None, BUILDING.grid) is None


def test_a_tutor_glances_once_and_before_it_labels() -> None:
    seen: list[np.ndarray] = []
    relabeller = Relabeller(BUILDING.grid, trained_labeler(), glanced=seen.append)
    paint = Paint.blank(BUILDING.grid.shape, trained_labeler().label_names_)
    for revision in range(2):
        relabelling = relabeller.answer(RelabelRequest(paint, revision, learns=False), Silent())
        assert len(seen) == 1
    assert (seen[0] == relabelling.labels)[BUILDING.grid.free].mean() > 0.8
