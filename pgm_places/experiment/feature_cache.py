"""Laser features of maps, kept on disk by what they are computed from."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.features.laser import DEFINITIONS_VERSION
from pgm_places.io.atomic import atomic_file
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.options import plain_values
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.feature_tables import Block

__all__ = ["FeatureCache"]


@dataclass(frozen=True)
class FeatureCache:
    """A folder of feature tables; maps of the same content share one, whatever they are called.

    A table takes 1.3 kB per labelled cell. Tables that are missing or unreadable are computed and
    kept; none is ever removed, and the folder may be deleted at any time.

    Parameters
    ----------
    folder : Path
        Created if needed.
    """

    folder: Path

    def key(self, item: LabelledMap, sensor: Sensor) -> str:
        """The SHA-256 of all that the features of a map's labelled cells depend on."""
        grid = item.grid
        about = {
            "version": __version__,
            "definitions": DEFINITIONS_VERSION,
            "sensor": plain_values(sensor),
            "resolution_m": grid.resolution_m,
            "shape": list(grid.shape),
        }
        digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
        digest.update(grid.cells.tobytes())
        digest.update(np.packbits(item.labelled_cells).tobytes())
        return digest.hexdigest()

    def kept(self, key: str, shape: tuple[int, int]) -> NDArray[np.float32] | None:
        """The table of that key, mapped from its file; None where there is none of this shape."""
        path = self._path(key)
        try:
            found = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError):  # not there, or cut off
            return None
        if found.shape != shape or found.dtype != np.float32:
            return None
        return np.asarray(found)

    def keep(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Write a table: rows (n, F) by their numbers, some at a time.

        Raises
        ------
        OutputError
            The folder cannot be written.
        """
        with atomic_file(self._path(key)) as path:
            table = open_memmap(path, "w+", np.float32, shape)
            for rows, values in blocks:
                table[rows] = values
            table.flush()

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npy"
