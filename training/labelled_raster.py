"""Labelled raster of 0.1 m, from a labelled map, for training the floor network."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.floor.architecture import LABELS
from pgm_places.floor.raster import FloorRaster, holders
from pgm_places.maps.labelled_map import LabelledMap

CIRCULATION = len(LABELS) + 1
"""The target of corridors on maps without a label of halls; targets of labels begin with 1."""


def labelled_raster(known: LabelledMap, label_names: Sequence[str]) -> dict[str, NDArray[np.uint8]]:
    """``free``, ``occ`` and ``lab`` (h, w), both even, in cells of 0.1 m.

    ``free`` is the share that is free, 0 to 255; ``occ`` is 255 where any part is occupied; ``lab``
    is the most frequent label of its cells: 0 for none, else from 1 on in the order of the
    network's labels, or ``CIRCULATION``. Labels that the network does not support become 0.
    """
    raster = FloorRaster.of(known.grid)
    rows, columns = (holders(n, known.grid.resolution_m) for n in known.grid.shape)
    cells = np.argwhere(known.labelled_cells)
    target = np.array([_target(name, label_names) for name in label_names])
    values = target[known.labels[tuple(cells.T)]]
    h, w = raster.shape
    votes = np.zeros((h * w, CIRCULATION + 1), np.int64)
    place = rows[cells[:, 0]] * w + columns[cells[:, 1]]
    np.add.at(votes, (place, values), 1)
    votes[:, 0] = 0
    labels = np.where(votes.any(axis=1), votes.argmax(axis=1), 0).reshape(h, w)
    even = [(0, n % 2) for n in (h, w)]
    return {
        "free": np.pad(raster.free, even),
        "occ": np.pad(raster.occupied.astype(np.uint8) * 255, even),
        "lab": np.pad(labels.astype(np.uint8), even),
    }


def _target(name: str, label_names: Sequence[str]) -> int:
    if name not in LABELS:
        return 0
    if name == "corridor" and "hall" not in label_names:
        return CIRCULATION
    return LABELS.index(name) + 1
