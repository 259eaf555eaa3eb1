"""Counts of objects over time, and the counts nearest to each step of a robot."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, frozen, integer_array
from pgm_places.errors import InputError
from pgm_places.vision.detector import MOST

__all__ = ["ObjectCounts"]


@dataclass(frozen=True, eq=False)
class ObjectCounts:
    """Counts of objects over time.

    Parameters
    ----------
    times_s : (T,) float
        When each observation was made; put in order here.
    counts : (T, D) int
        Objects of each class in each observation, at least 0.
    object_names : tuple of D str
        The classes, all different.

    Raises
    ------
    InputError
        Shapes that do not fit, negative counts, or a name that comes twice.

    Examples
    --------
    >>> seen = ObjectCounts([0.0, 2.0], [[0, 1], [3, 0]], ("monitor on", "coffee machine"))
    >>> seen.at([0.1, 1.2, 60.0], within_s=5.0).tolist()
    [[0.0, 1.0], [3.0, 0.0], [0.0, 0.0]]
    """

    times_s: NDArray[np.float64]
    counts: NDArray[np.int64]
    object_names: tuple[str, ...]

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.object_names)
        twice = sorted(name for name, times in Counter(names).items() if times > 1)
        if twice:
            raise InputError(f"object_names must differ, got {', '.join(twice)} more than once")
        times = finite_array("times_s", self.times_s, ("T",))
        if not names and np.size(self.counts):
            raise InputError("counts need object_names, one per column")
        counts = integer_array("counts", self.counts, (len(times), len(names)), low=0, high=MOST)
        order = np.argsort(times, kind="stable")
        object.__setattr__(self, "times_s", frozen(times[order]))
        object.__setattr__(self, "counts", frozen(counts[order]))
        object.__setattr__(self, "object_names", names)

    def __len__(self) -> int:
        return len(self.times_s)

    def __repr__(self) -> str:
        return f"ObjectCounts({len(self)} observations of {', '.join(self.object_names)})"

    def at(
        self,
        times_s: ArrayLike,
        *,
        within_s: float,
        object_names: Sequence[str] | None = None,
    ) -> NDArray[np.float32]:
        """(S, D) feature columns at the times of S steps: the counts of the nearest observation.

        Parameters
        ----------
        times_s : (S,) float
            Times of the steps, on the same clock.
        within_s : float
            Where no observation is so near in time, nothing was seen: zeros.
        object_names : sequence of str, optional
            The columns wanted, such as those that a model learned with; one that this record does
            not have is zero throughout.

        Raises
        ------
        InputError
            ``within_s`` is negative, or the times are not finite.
        """
        if not within_s >= 0:
            raise InputError(f"within_s must be at least 0 seconds, got {within_s}")
        wanted = finite_array("times_s", times_s, ("S",))
        names = self.object_names if object_names is None else tuple(object_names)
        columns = np.zeros((len(wanted), len(names)), np.float32)
        if not len(self):
            return columns
        nearest = self._nearest(wanted)
        seen = np.abs(self.times_s[nearest] - wanted) <= within_s
        for column, name in enumerate(names):
            if name in self.object_names:
                of_name = self.counts[nearest, self.object_names.index(name)]
                columns[:, column] = np.where(seen, of_name, 0)
        return columns

    def seconds_from(self, times_s: ArrayLike) -> NDArray[np.float64]:
        """(S,) seconds from each time (S,) to the nearest observation; inf where there is none."""
        wanted = finite_array("times_s", times_s, ("S",))
        if not len(self):
            return np.full(len(wanted), np.inf)
        return np.asarray(np.abs(self.times_s[self._nearest(wanted)] - wanted))

    def _nearest(self, wanted: NDArray[np.float64]) -> NDArray[np.int64]:
        """(S,) number of the observation nearest to each time; of two, the earlier."""
        after = np.searchsorted(self.times_s, wanted).clip(0, len(self) - 1)
        before = (after - 1).clip(0)
        is_before = wanted - self.times_s[before] <= self.times_s[after] - wanted
        return np.where(is_before, before, after)
