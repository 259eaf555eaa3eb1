"""A labeler that learns in no time, for tests of what is done with a labeler."""

from functools import lru_cache

from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.options import SpaceOptions
from tests.drives import building


@lru_cache
def places() -> PlaceLabeler:
    """Learned on the building of :mod:`tests.drives`."""
    known, names = building()
    return PlaceLabeler(
        names,
        sensor=Sensor(max_range_m=12.0),
        classifier=DecisionListClassifier(n_rounds=30, order="heuristic"),
        space=SpaceOptions(n_rounds=5),
        max_examples_per_map=2000,
        n_folds=2,
        unary="space",
    ).fit([known])
