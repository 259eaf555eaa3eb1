"""The protocol of object detectors: cameras, files and simulations."""

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError

__all__ = ["N_IMAGES", "PAPER_OBJECTS", "Detector", "count_objects"]

N_IMAGES = 8
"""Images of one observation in the paper: a panorama."""

MOST = 1 << 31
"""No count is larger: whatever says so is damaged."""

PAPER_OBJECTS = (
    "monitor on",
    "monitor off",
    "coffee machine",
    "office cupboard",
    "frontal face",
    "face profile",
    "full human body",
    "upper human body",
)
"""The objects O of the paper, in its order."""

Observation = TypeVar("Observation", contravariant=True)


@runtime_checkable
class Detector(Protocol[Observation]):
    """Anything that counts objects in an observation.

    An observation is what the detector looks at: the images of a panorama for one that sees, a
    pose for one that is simulated.
    """

    @property
    def object_names(self) -> tuple[str, ...]:
        """The D classes of objects that it can find."""
        ...

    def count(self, observation: Observation) -> NDArray[np.int64]:
        """(D,) how many of each class it finds: f_o(v), summed over all images of v (sec. 4.1)."""
        ...


def count_objects(
    detector: Detector[Observation], observations: Iterable[Observation]
) -> NDArray[np.int64]:
    """(T, D) counts of each of T observations, in their order.

    Parameters
    ----------
    detector : Detector
    observations : iterable
        What the detector looks at, one after the other; only one is held at a time.

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
