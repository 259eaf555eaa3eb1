"""An experiment: its configuration and folder, the records of its runs, its feature cache."""

import hashlib
import json
import os
import shutil
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.errors import LearningWarning, OutputError
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.source_config import SourceConfig
from pgm_places.experiment.source_patterns import resolved_path
from pgm_places.features.laser import DEFINITIONS_VERSION
from pgm_places.io.atomic import atomic_file
from pgm_places.io.input_file import sha256_of
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.options import plain_values
from pgm_places.progress import Progress, Silent, report_stage, reporting_to
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


DATA_VARIABLE = "PGM_PLACES_DATA"


@dataclass(frozen=True)
class Experiment:
    """A configuration with the folder of its paths, and the records of its runs.

    ``selection`` has the candidates of a selection of options. Variants of an experiment
    (``dataclasses.replace``) share the records: the hash of each input file, the seconds of each
    stage, and warnings.
    """

    config: ExperimentConfig
    folder: Path
    progress: Progress = field(default_factory=Silent)
    n_threads: int | None = None
    feature_cache: FeatureCache | None = None
    selection: Mapping[str, Any] | None = None
    inputs: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Run a block with the experiment's threads and progress; its time counts for a stage."""
        start = time.perf_counter()
        try:
            with thread_limit(self.n_threads), reporting_to(self.progress):
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def loaded(
        self,
        part: str,
        what: str,
        wanted: Callable[[SourceConfig], bool],
        load: Callable[["Experiment", SourceConfig, str], Any],
    ) -> list[Any]:
        """Load the wanted sources of ``"train"`` or ``"test"``, in order.

        The last argument of ``load`` is the position of a source in the file, for messages.
        """
        sources = enumerate(getattr(self.config, part))
        chosen = [(f"{part}[{index}]", source) for index, source in sources if wanted(source)]
        loaded: list[Any] = []
        with self.timed("load"), report_stage(f"{part} {what}") as stage:
            for where, source in chosen:
                loaded.append(load(self, source, where))
                stage.update(len(loaded) / len(chosen), loaded[-1].name)
        return loaded

    @contextmanager
    def learning(self) -> Iterator[None]:
        """The stage ``learn``, whose warnings are recorded."""
        with self.timed("learn"), warnings.catch_warnings():
            warnings.simplefilter("always", LearningWarning)
            show_other = warnings.showwarning

            def show(
                message: Warning | str, category: type[Warning], *where: Any, **named: Any
            ) -> None:
                if issubclass(category, LearningWarning):
                    self.warn(str(message))
                else:
                    show_other(message, category, *where, **named)

            warnings.showwarning = show
            yield

    def warn(self, message: str) -> None:
        """Record a warning and show it once."""
        if message not in self.warnings:
            self.warnings.append(message)
            self.progress.warn(message)

    def resolve(self, name: str) -> Path:
        """The absolute path of a name in the configuration."""
        return resolved_path(name, self.folder)

    @contextmanager
    def input_path(self, name: str) -> Iterator[Path]:
        """The path of a name in the configuration, whose hash is recorded after the block."""
        path = self.resolve(name)
        yield path
        self.record_input(path)

    def record_input(self, path: Path) -> None:
        """Record the hash of a file that was read, under the shortest unambiguous name."""
        self.inputs[self._shown(path)] = sha256_of(path)

    def _shown(self, path: Path) -> str:
        """The path relative to the data folder or the configuration, for portable results."""
        data = os.environ.get(DATA_VARIABLE)
        if data and path.is_relative_to(Path(data).resolve()):
            return f"${DATA_VARIABLE}/{path.relative_to(Path(data).resolve()).as_posix()}"
        if path.is_relative_to(self.folder):
            return path.relative_to(self.folder).as_posix()
        return str(path)
