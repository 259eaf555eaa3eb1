"""Whether a label image lies on its map as it is, or only once it is flipped or turned."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Orientation"]

# Shares of labels off the free cells. Labels that were drawn by hand spill over walls, whichever
# way they lie; the wrong way they spill several times as much. Of 121 label images of real floors,
# flipped, the one that fits best has 2.7 % off.
_TIMES, _MARGIN = 4.0, 0.01
_TIMES_DOUBTED = 2.0
_MANY_OFF = 0.2
# Nothing is known of fewer labels off the free cells than this, nor of labels on a smaller part of
# the free cells: strokes of paint lie on free cells wherever they are put.
_FEWEST, _LEAST_COVERED = 20, 0.2


@dataclass(frozen=True)
class Orientation:
    """How the labels of an image lie on the free cells of its map.

    Parameters
    ----------
    on_free : float
        Share of the labelled pixels that lie on free cells.
    best : float
        The same, the way round in which it is largest.
    what, remedy : str
        What the image is like against that, and what to do about it; empty where it is best as it
        is.
    is_wrong : bool
        Whether it is certain that the image lies the wrong way round.
    is_doubtful : bool
        Whether it may be, or may be of another map.
    """

    on_free: float
    best: float = 0.0
    what: str = ""
    remedy: str = ""
    is_wrong: bool = False
    is_doubtful: bool = False

    @classmethod
    def of(cls, labelled: NDArray[np.bool_], free: NDArray[np.bool_]) -> "Orientation":
        """Of a mask of the labelled cells (H, W), at least one, on the free cells; row 0 below."""
        n_labelled = int(np.count_nonzero(labelled))
        n_on_free = int(np.count_nonzero(labelled & free))
        on_free, off = n_on_free / n_labelled, 1 - n_on_free / n_labelled
        if n_labelled - n_on_free < _FEWEST and off <= _MANY_OFF:
            return cls(on_free)
        shares = {
            words: float(np.count_nonzero(view & free[::-1]) / n_labelled)
            for words, view in _views(labelled[::-1])
        }
        (what, remedy), best = max(shares.items(), key=lambda item: item[1])
        if best <= on_free:
            return cls(on_free, on_free, is_doubtful=off > _MANY_OFF)
        covers = n_labelled >= _LEAST_COVERED * int(np.count_nonzero(free))
        is_wrong = covers and off >= _TIMES * (1 - best) + _MARGIN
        doubted = covers and off >= _TIMES_DOUBTED * (1 - best) + _MARGIN
        return cls(on_free, best, what, remedy, is_wrong, off > _MANY_OFF or doubted)


def _views(image: NDArray[np.bool_]) -> Iterator[tuple[tuple[str, str], NDArray[np.bool_]]]:
    """An image (row 0 on top) turned and flipped in all ways that keep its size; in words."""
    yield ("upside down", "flip it vertically"), image[::-1]
    yield ("mirrored left to right", "flip it horizontally"), image[:, ::-1]
    yield ("turned by 180 degrees", "turn it by 180 degrees"), image[::-1, ::-1]
    if image.shape[0] == image.shape[1]:
        yield ("turned clockwise", "turn it by 90 degrees anticlockwise"), np.rot90(image)
        yield ("turned anticlockwise", "turn it by 90 degrees clockwise"), np.rot90(image, -1)
        turned = "turn it by 90 degrees clockwise, then flip it"
        yield ("mirrored at a diagonal", f"{turned} horizontally"), image.T
        yield ("mirrored at a diagonal", f"{turned} vertically"), image[::-1, ::-1].T
