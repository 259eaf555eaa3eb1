"""Laser features of maps, cached on disk under a hash of their inputs."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.errors import OutputError
from pgm_places.features.laser import DEFINITIONS_VERSION
from pgm_places.io.atomic import atomic_file
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.options import plain_values
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.feature_table import Block

# Largest share of the free disk space for tables.
MOST_OF_FREE = 0.9


@dataclass(frozen=True)
class FeatureCache:
    """A folder of feature tables, by hash of the map's content.

    A table takes 1.3 kB per cell. Missing or unreadable tables are computed and stored. Tables are
    never removed, but the folder may be deleted at any time. ``tell`` is called with a line on the
    size of the tables before they are written.
    """

    folder: Path
    tell: Callable[[str], object] | None = None

    def key(self, item: LabelledMap, sensor: Sensor, mask: NDArray[np.bool_]) -> str:
        """The SHA-256 of all inputs of the features of the cells in a mask (H, W)."""
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
        digest.update(np.packbits(mask).tobytes())
        return digest.hexdigest()

    def get(self, key: str, shape: tuple[int, int]) -> NDArray[np.float32] | None:
        """The table of a key, mapped from its file; None if there is no table of this shape."""
        path = self._path(key)
        try:
            table = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError):  # missing or truncated
            return None
        if table.shape != shape or table.dtype != np.float32:
            return None
        return np.asarray(table)

    def check_space(self, shapes: Sequence[tuple[int, int]]) -> None:
        """Report the size of tables of these shapes; OutputError if the disk is too small."""
        n_cells = sum(n for n, _ in shapes)
        if not n_cells:
            return
        n_bytes = sum(4 * n * n_columns for n, n_columns in shapes)
        there = next(
            path for path in (self.folder, *self.folder.absolute().parents) if path.exists()
        )
        free = shutil.disk_usage(there).free
        what = f"the features of {n_cells:,} cells of {len(shapes):,} maps"
        if n_bytes > MOST_OF_FREE * free:
            raise OutputError(
                f"{what} need {_size(n_bytes)} in {self.folder}, where {_size(free)} are free; "
                "choose a folder on a larger disk, train without --cache, or set "
                "max_examples_per_map (but methods trained on scores use all cells)"
            )
        if self.tell is not None:
            self.tell(f"{what} will take {_size(n_bytes)} in {self.folder}")

    def put(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Write a table block by block: row indices and rows (n, F)."""
        with atomic_file(self._path(key)) as path:
            table = open_memmap(path, "w+", np.float32, shape)
            _reserve(path)
            for rows, values in blocks:
                table[rows] = values
            table.flush()

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npy"


def _reserve(path: Path) -> None:
    """Allocate the file's disk space, because writing a mapped file on a full disk is fatal."""
    if hasattr(os, "posix_fallocate"):
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, path.stat().st_size)


def _size(n_bytes: float) -> str:
    return f"{n_bytes / 1e9:,.1f} GB" if n_bytes >= 1e9 else f"{n_bytes / 1e6:.1f} MB"
