"""The options of labelling live: how scans become places, and when the map is labelled again."""

from dataclasses import dataclass

from pgm_places.options import AtLeastZero, Positive, Probability, check_options


@dataclass(frozen=True)
class LiveOptions:
    """How scans become places, and when the map is labelled again.

    Parameters
    ----------
    min_probability : float
        Labels less probable than this do not replace the previous one.
    hysteresis_s : float
        A place counts as changed once the new one has lasted this long (s).
    relabel_min_period_s : float
        Shortest time between two labellings of the map (s); if maps arrive faster, only the
        newest is labelled.

    Examples
    --------
    >>> LiveOptions(hysteresis_s=0.2).relabel_min_period_s
    5.0
    """

    min_probability: Probability = 0.0
    hysteresis_s: AtLeastZero = 0.5
    relabel_min_period_s: Positive = 5.0

    def __post_init__(self) -> None:
        check_options(self)
