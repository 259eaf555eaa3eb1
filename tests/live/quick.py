"""A labeler that learns in no time, for tests of labelling live."""

from functools import lru_cache

from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.sensing.sensor import Sensor
from tests.drives import building


@lru_cache
def places() -> PlaceLabeler:
    """Learned on the building of :mod:`tests.drives`."""
    known, names = building()
    quick = DecisionListClassifier(n_rounds=10, order="heuristic")
    return PlaceLabeler(names, sensor=Sensor(max_range_m=12.0), classifier=quick).fit([known])
