"""Checks: places by the area that is likely to be labelled wrongly."""

from dataclasses import dataclass

from pgm_places._arguments import public
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap


@dataclass(frozen=True, eq=False)
class PlaceCheck:
    """A place with its uncertainty.

    Parameters
    ----------
    place : Region
    probability : float
        Probability of its label: the place's confidence.
    second_label : str or None
        The most probable other label; None if there is no other.
    second_probability : float or None
        Its probability: a share of ``1 - probability`` in proportion to the mean over the place's
        cells, as the probability of a gate may differ from that of its cells.
    """

    place: Region
    probability: float
    second_label: str | None
    second_probability: float | None

    @property
    def doubt(self) -> float:
        """The probability that the label is wrong, 0 to 1."""
        return 1.0 - self.probability

    @property
    def doubtful_m2(self) -> float:
        """Doubt times area: the expected wrongly labelled area."""
        return self.doubt * self.place.area_m2


@public
def places_to_check(topology: TopologicalMap) -> list[PlaceCheck]:
    """The places of a map with known probabilities, by descending uncertain area.

    With calibrated probabilities, checking places in this order corrects the most area with the
    fewest checks.

    Examples
    --------
    >>> from pgm_places import LabelGraph, OccupancyGrid, topological_map
    >>> grid = OccupancyGrid([[0, 0, 0, 0]], resolution_m=1.0)
    >>> found = topological_map(
    ...     grid,
    ...     [[0, 0, 1, 1]],
    ...     ["room", "corridor"],
    ...     beliefs=[[0.9, 0.1], [0.9, 0.1], [0.4, 0.6], [0.3, 0.7]],
    ...     layout=LabelGraph.from_grid(grid).layout,
    ... )
    >>> for check in places_to_check(found):
    ...     print(f"{check.place.name}: {check.doubtful_m2:.1f} m2, or {check.second_label}")
    corridor 2: 0.7 m2, or room
    room 1: 0.2 m2, or corridor
    """
    found = [
        PlaceCheck(region, region.confidence, *_second(region, topology.label_names))
        for region in topology.regions
        if region.confidence is not None
    ]
    return sorted(found, key=lambda check: (-check.doubtful_m2, check.place.id))


def doubtful_share(topology: TopologicalMap) -> float | None:
    """The expected share of wrongly labelled area; None without probabilities.

    Places without probabilities are left out. Probabilities of gates only do not suffice.
    """
    checks = places_to_check(topology)
    if all(check.place.probabilities is None for check in checks):
        return None
    area_m2 = sum(check.place.area_m2 for check in checks)
    return sum(check.doubtful_m2 for check in checks) / area_m2 if area_m2 else None


def _second(place: Region, label_names: tuple[str, ...]) -> tuple[str | None, float | None]:
    """The most probable label other than the place's own, and its probability."""
    known = zip(label_names, place.probabilities or (), strict=False)
    others = {name: probability for name, probability in known if name != place.label}
    total = sum(others.values())
    if not total or place.confidence is None:
        return None, None
    name = max(others, key=lambda label: others[label])
    return name, others[name] / total * (1.0 - place.confidence)
