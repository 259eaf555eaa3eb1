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
        with open_image(path, InputError) as image:
            shares = image.stored()
        if shares.shape != layout.shape:
            raise InputError(
                f"{path}: expected a grey image of the map's {layout.shape} pixels, got "
                f"{shares.shape}; label the map again"
            )
        beliefs[:, k] = layout.from_raster(shares[::-1])
    beliefs /= np.maximum(beliefs.sum(axis=1, keepdims=True), 1.0)
    return beliefs
