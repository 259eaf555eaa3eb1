"""The probability images that ``pgm-places label`` writes, read back for the cells of a map."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.io.maps.raster_image import open_image


def probability_file(label: str) -> str:
    """The name of a label's image: 0 to 255 for a probability of 0 to 1, 0 outside free cells."""
    return f"probability_{label}.png"


def read_shares(path: Path, shape: tuple[int, ...], error: type[InputError]) -> NDArray[np.integer]:
    """(H, W) the greys of such an image, row 0 at the bottom.

    Raises
    ------
    error
        It is damaged, or not of the map's shape.
    """
    with open_image(path, error) as image:
        if image.shape != shape or image.is_indexed or image.is_deep:
            raise error(
                f"{path}: expected 8-bit grey values in {shape[0]} rows x {shape[1]} columns, as "
                "the map has; label the map again"
            )
        return image.stored()[::-1]


def load_probabilities(
    folder: Path, label_names: Sequence[str], layout: GridLayout
) -> NDArray[np.float32] | None:
    """(N, K) probability of each label at the nodes of a map; None where a label has no image.

    They were rounded to 1/255, and are made to add up to one again.

    Parameters
    ----------
    folder : Path
    label_names : sequence of str
    layout : GridLayout
        The free cells of the map.

    Raises
    ------
    InputError
        An image is damaged, or is not of the map's size.
    """
    paths = [folder / probability_file(name) for name in label_names]
    if not all(path.exists() for path in paths):
        return None
    beliefs = np.empty((layout.n_nodes, len(paths)), np.float32)
    for k, path in enumerate(paths):
        beliefs[:, k] = layout.from_raster(read_shares(path, layout.shape, InputError))
    beliefs /= np.maximum(beliefs.sum(axis=1, keepdims=True), 1.0)
    return beliefs
