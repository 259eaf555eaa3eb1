"""Objects in images: detectors, and counts over time as further features of a drive's steps."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array, require_at_least, set_frozen
from pgm_places.errors import InputError

N_IMAGES = 8
"""Number of images of one observation in the paper, a panorama."""

# Larger counts are treated as damage.
MOST = 1 << 31

PAPER_OBJECTS = (
    "monitor on", "monitor off", "coffee machine", "office cupboard",
    "frontal face", "face profile", "full human body", "upper human body",
)  # fmt: skip
"""The objects O of the paper, in its order."""

Observation = TypeVar("Observation", contravariant=True)


@runtime_checkable
class Detector(Protocol[Observation]):
    """Anything that counts objects in an observation.

    An observation is the input of the detector: the images of a panorama, or the pose for a
    simulated detector.
    """

    @property
    def object_names(self) -> tuple[str, ...]:
        """The D classes of objects that it can find."""
        ...

    def count(self, observation: Observation) -> NDArray[np.int64]:
        """(D,) counts of each class: f_o(v), summed over all images of v (sec. 4.1)."""
        ...


def count_objects(
    detector: Detector[Observation], observations: Iterable[Observation]
) -> NDArray[np.int64]:
    """(T, D) counts of each of T observations, in their order.

    Parameters
    ----------
    detector : Detector
    observations : iterable
        Inputs of the detector, of which only one is in memory at a time.

    Raises
    ------
    InputError
        The detector returns anything but one count per class.

    Examples
    --------
    >>> class BrightSpots:
    ...     object_names = ("lamp",)
    ...
    ...     def count(self, observation):
    ...         return np.array([sum(int((image > 250).any()) for image in observation)])
    >>> panorama = [np.zeros((4, 4), np.uint8), np.full((4, 4), 255, np.uint8)]
    >>> count_objects(BrightSpots(), [panorama, panorama[:1]]).tolist()
    [[1], [0]]
    """
    names = tuple(detector.object_names)
    rows = [_checked(detector.count(item), names) for item in observations]
    return np.array(rows, np.int64).reshape(len(rows), len(names))


def _checked(counts: NDArray[np.int64], names: Sequence[str]) -> NDArray[np.int64]:
    try:
        return integer_array("counts", counts, (len(names),), low=0, high=MOST)
    except InputError as error:
        listed = ", ".join(names)
        raise InputError(f"a detector of {listed} must count each of them: {error}") from None


@dataclass(frozen=True, eq=False)
class ObjectCounts:
    """Counts of objects over time.

    Parameters
    ----------
    times_s : (T,) float
        Time of each observation; sorted here.
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
    >>> counts = ObjectCounts([0.0, 2.0], [[0, 1], [3, 0]], ("monitor on", "coffee machine"))
    >>> counts.at([0.1, 1.2, 60.0], within_s=5.0).tolist()
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
        set_frozen(self, times_s=times[order], counts=counts[order], object_names=names)

    def __len__(self) -> int:
        return len(self.times_s)

    def __repr__(self) -> str:
        return f"ObjectCounts({len(self)} observations of {', '.join(self.object_names)})"

    def at(
        self, times_s: ArrayLike, *, within_s: float, object_names: Sequence[str] | None = None
    ) -> NDArray[np.float32]:
        """(S, D) feature columns at the times of S steps: the counts of the nearest observation.

        Parameters
        ----------
        times_s : (S,) float
            Times of the steps, on the same clock.
        within_s : float
            Steps without an observation within this time get zeros.
        object_names : sequence of str, optional
            The columns to return, such as those of a model; columns that are not recorded are 0.

        Raises
        ------
        InputError
            ``within_s`` is negative, or the times are not finite.
        """
        require_at_least("within_s", within_s, 0, "seconds")
        wanted = finite_array("times_s", times_s, ("S",))
        names = self.object_names if object_names is None else tuple(object_names)
        columns = np.zeros((len(wanted), len(names)), np.float32)
        if not len(self):
            return columns
        nearest = self._nearest(wanted)
        is_near = np.abs(self.times_s[nearest] - wanted) <= within_s
        for column, name in enumerate(names):
            if name in self.object_names:
                of_name = self.counts[nearest, self.object_names.index(name)]
                columns[:, column] = np.where(is_near, of_name, 0)
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
