"""Labels that lie the wrong way round on their map, and those that only spill over walls."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.io.maps.label_image import Orientation

Mask = NDArray[np.bool_]
WAYS: dict[str, Callable[[Mask], Mask]] = {
    "flip it vertically": lambda image: image[::-1],
    "flip it horizontally": lambda image: image[:, ::-1],
    "turn it by 180 degrees": lambda image: image[::-1, ::-1],
}
CLOCKWISE, BACK = "turn it by 90 degrees clockwise", "turn it by 90 degrees anticlockwise"
OF_SQUARES = WAYS | {
    CLOCKWISE: lambda image: np.rot90(image, -1),
    BACK: np.rot90,
    f"{CLOCKWISE}, then flip it horizontally": lambda image: np.rot90(image, -1)[:, ::-1],
    f"{CLOCKWISE}, then flip it vertically": lambda image: np.rot90(image, -1)[::-1],
}
INVERSE = {name: name for name in OF_SQUARES} | {CLOCKWISE: BACK, BACK: CLOCKWISE}


def floor(*, wide: int = 60, closets: int = 3) -> Mask:
    """Free cells of a floor that is nearly its own mirror image, but for some closets."""
    free = np.zeros((60, wide), np.bool_)
    free[2:-2, 2:-2] = True
    free[30:32] = free[:, 29:31] = False
    for k in range(closets):
        free[4 + 5 * k : 7 + 5 * k, 5 + 2 * k : 9 + 2 * k] = False
    return free


@pytest.mark.parametrize(
    ("wide", "remedy"), [*((60, name) for name in OF_SQUARES), *((80, name) for name in WAYS)]
)
def test_the_remedy_brings_the_labels_to_the_free_cells(wide: int, remedy: str) -> None:
    free = floor(wide=wide)  # row 0 is the bottom, but that of an image the top
    image = OF_SQUARES[INVERSE[remedy]](free[::-1])
    assert (OF_SQUARES[remedy](image) == free[::-1]).all()
    found = Orientation.of(image[::-1], free)
    assert found.is_wrong
    assert found.remedy == remedy
    assert found.best == 1


def test_labels_that_spill_over_walls_are_neither_refused_nor_doubted() -> None:
    spilt = floor()
    spilt[12:40, :] = spilt[:, 25:35] = True
    found = Orientation.of(spilt, floor())
    assert found.on_free < 0.95
    assert (found.remedy, found.is_wrong, found.is_doubtful) == ("", False, False)


@pytest.mark.parametrize("at", range(3, 40, 6))
def test_strokes_of_paint_lie_on_free_cells_whichever_way(at: int) -> None:
    free = floor(closets=6)
    stroke = np.zeros_like(free)
    stroke[at : at + 8, 4:14] = True
    found = Orientation.of(stroke, free)
    assert not found.is_wrong
    assert found.is_doubtful == (found.on_free < 0.8)


def test_a_floor_that_is_its_own_mirror_image_tells_nothing() -> None:
    free = floor(closets=0)
    found = Orientation.of(free[:, ::-1], free)
    assert (found.on_free, found.is_wrong, found.is_doubtful) == (1, False, False)


@pytest.mark.parametrize(("spilt", "is_doubtful"), [(5, True), (120, False)])
def test_what_fits_better_the_other_way_but_not_well_is_doubted(
    spilt: int, is_doubtful: bool
) -> None:
    free = floor()
    image = free[:, ::-1].copy()
    image[:2].flat[:spilt] = True  # off the free cells whichever way it lies
    found = Orientation.of(image, free)
    assert found.what == "mirrored left to right"
    assert (found.is_wrong, found.is_doubtful) == (False, is_doubtful)
