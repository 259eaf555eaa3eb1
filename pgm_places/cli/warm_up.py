"""Warm-up: during the first stages of a first run, a second process compiles the later ones.

A process compiles one kernel at a time, whatever its number of threads. So the second process runs
the later stages on a tiny map, and leaves their machine code in the cache that both share. A run
that comes to a kernel before the other is done with it compiles it itself.
"""

import gc
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Self

from pgm_places.batch.worker_process import end_with_parent

if TYPE_CHECKING:
    from pgm_places.inference.problem import LabelingProblem

__all__ = ["COMMAND", "STAGES", "WarmUp", "main"]

COMMAND = (sys.executable, "-P", "-m", "pgm_places.cli.warm_up")
"""Without -P, Python would look for every library in the current folder first."""


class WarmUp:
    """The second process, for as long as the context lasts.

    It is started by the first stage that has never run on this machine.

    Parameters
    ----------
    stages : sequence of str
        The stages that are known from the start; others are added by :meth:`compile`.
    n_threads : int, optional
        The threads that the run itself may use; for a single one no process is started.
    """

    def __init__(self, stages: Sequence[str] = (), *, n_threads: int | None = None) -> None:
        self._stages, self._n_threads = tuple(stages), n_threads
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        self.compile(self._stages)
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def compile(self, stages: Sequence[str]) -> None:
        """Compile those of the stages that are new, after those of earlier calls.

        Nothing is done where no cache can be written.

        Parameters
        ----------
        stages : sequence of str
            Names of ``STAGES``; others are passed over.
        """
        waiting = [name for name in stages if name in STAGES and _is_new(name)]
        if not waiting or not sys.executable or _only_one(self._n_threads):
            return
        self._process = self._process or _started()
        with suppress(OSError):  # it may have ended; then the run compiles what it needs
            _input(self._process).write("".join(f"{name}\n" for name in waiting))
            _input(self._process).flush()

    def end(self) -> None:
        """Stop compiling; what is compiled by now stays in the cache."""
        if self._process is None:
            return
        self._process.terminate()
        self._process.wait()
        with suppress(OSError):
            _input(self._process).close()


def _started() -> subprocess.Popen[str]:
    return subprocess.Popen(
        COMMAND,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def _input(process: subprocess.Popen[str]) -> IO[str]:
    assert process.stdin is not None  # it was started with a pipe
    return process.stdin


def main(stages: Iterable[str]) -> None:
    """Go through the stages, and note down each so that it is not gone through again."""
    gc.set_threshold(100_000, 50, 50)  # as in the run itself
    for line in stages:
        name = line.strip()
        STAGES[name]()
        mark = _mark(name)
        if mark is not None:
            mark.touch()


def _only_one(n_threads: int | None) -> bool:
    from pgm_places.kernels.threads import resolve_threads

    return resolve_threads(n_threads) < 2


def _is_new(name: str) -> bool:
    mark = _mark(name)
    return mark is not None and not mark.exists()


def _mark(name: str) -> Path | None:
    """The file that says that a stage has been compiled, by this Python and this compiler.

    None where there is nothing to compile, or no place to keep it.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return None
    from pgm_places.kernels.cache import cache_folder
    from pgm_places.kernels.numba_version import numba_version
    from pgm_places.kernels.shipped_code import shipped_folder

    folder = cache_folder() if shipped_folder() is None else None
    if folder is None:
        return None
    return folder / f"{name}-python{platform.python_version()}-numba{numba_version()}"


def _warm_up_features() -> None:
    """The families that come last and take longest; the run itself comes to the others first."""
    import numpy as np

    from pgm_places.features.extraction import extract
    from pgm_places.features.laser import laser_feature_names

    families = {"f16", "f17", "f18", "f19"}
    names = [name.partition("_")[0] for name in laser_feature_names()]
    columns = [column for column, family in enumerate(names) if family in families]
    extract(np.ones((2, 360), np.float32), max_range_m=10.0, columns=columns)


def _warm_up_scans() -> None:
    """Scans from the cells of a map and all features, while the run itself divides the map."""
    import numpy as np

    from pgm_places.features.extraction import extract
    from pgm_places.maps.occupancy_grid import OccupancyGrid
    from pgm_places.sensing.ray_casting import iter_cast
    from pgm_places.sensing.sensor import Sensor

    cells = np.zeros((8, 8), np.int8)
    cells[0] = 100
    for block in iter_cast(OccupancyGrid(cells, 0.05), Sensor()):
        extract(block.ranges, max_range_m=30.0)


def _warm_up_segments() -> None:
    from pgm_places.datasets import generate_building
    from pgm_places.spaces.gates import gate_candidates
    from pgm_places.spaces.segmentation import Segmentation
    from pgm_places.unary.space_model import MapSpaces, gate_probabilities

    gates = gate_candidates(Segmentation.of(generate_building(size="small").grid))
    MapSpaces.of(gates, gate_probabilities(None, [[]] * len(gates)))


def _warm_up_space() -> None:
    """Looking up what one cell sees of a segment, trees, and making spaces whole.

    The run itself divides the map.
    """
    import numpy as np

    from pgm_places.maps.components import connected_components
    from pgm_places.models.boosted_trees import BoostedTrees
    from pgm_places.solvers.max_flow import minimum_cut
    from pgm_places.spaces.segment_lookup import SegmentLookup

    none, one = np.zeros(1, np.int64), np.zeros((1, 1), np.float32)
    lookup = SegmentLookup(
        none.astype(np.int32), one, np.ones(1), np.zeros(2, np.int64), np.zeros((0, 5)), 1.0
    )
    cells = np.zeros((1, 2), np.int32)
    lookup.write(cells, cells[0, :1], np.zeros(1), none, none, one)
    cut, value = np.full((1, 3), np.inf, np.float32), np.zeros((1, 4), np.float32)
    BoostedTrees(np.full((1, 3), -1, np.int32), cut, value).scores(one)
    minimum_cut([1.0, 0.0], [0.0, 1.0], [(0, 1)], [1.0], [1.0])
    connected_components(cells)


def _warm_up_topology() -> None:
    """By labels; gates need components of larger numbers besides."""
    import numpy as np

    from pgm_places.datasets import generate_building
    from pgm_places.maps.components import connected_components
    from pgm_places.topology.from_labels import topological_map

    building = generate_building(size="small")
    topological_map(building.grid, building.labels, building.label_names)
    connected_components(building.labels.astype(np.int32))


def _blank_problem() -> "LabelingProblem":
    """A grid of 4 x 4 cells and three labels, of which none is better."""
    import numpy as np

    from pgm_places.graph.label_graph import LabelGraph
    from pgm_places.inference.problem import LabelingProblem
    from pgm_places.maps.occupancy_grid import OccupancyGrid

    graph = LabelGraph.from_grid(OccupancyGrid(np.zeros((4, 4), np.int8), 1.0))
    return LabelingProblem(graph, ("a", "b", "c"), unary=np.zeros((16, 3)))


def _warm_up_relaxation() -> None:
    import numpy as np

    from pgm_places.models.relaxation import Relaxation

    problem = _blank_problem()
    Relaxation().fit([problem], [np.arange(16) % 3]).infer(problem)


def _warm_up_potts() -> None:
    """Mean field, as the shipped models use it."""
    from pgm_places.models.mrf import PottsField

    PottsField(inference="mean-field").infer(_blank_problem())


def _warm_up_boosting() -> None:
    import numpy as np

    from pgm_places.models.decision_list import DecisionListClassifier

    rng = np.random.default_rng(0)
    features = rng.random((300, 8), np.float32)
    truth = np.arange(300) % 3
    groups = np.arange(300) // 60
    fitted = DecisionListClassifier(n_rounds=3).fit(features, truth, groups=groups)
    fitted.boosted_list_.log_histogram(features)


def _warm_up_trees() -> None:
    """Growing trees, of the depths that spaces are learned with."""
    import numpy as np

    from pgm_places.models.decision_list import DecisionListClassifier

    rng = np.random.default_rng(0)
    features = rng.random((300, 8), np.float32)
    DecisionListClassifier(n_rounds=2, max_depth=3, shrinkage=0.3).fit(
        features, np.arange(300) % 3, groups=np.arange(300) // 60
    )


def _warm_up_amn() -> None:
    import numpy as np

    from pgm_places.graph.label_graph import LabelGraph
    from pgm_places.inference.problem import LabelingProblem
    from pgm_places.maps.occupancy_grid import OccupancyGrid
    from pgm_places.models.amn import AssociativeMarkovNetwork

    rng = np.random.default_rng(0)
    graph = LabelGraph.from_grid(OccupancyGrid(np.zeros((12, 12), np.int8), 1.0))
    truth = rng.integers(0, 3, 144)
    unary = np.log(rng.dirichlet(np.ones(3), 144))
    problem = LabelingProblem(graph, ("a", "b", "c"), unary, rng.random((144, 4)))
    AssociativeMarkovNetwork().fit([problem], [truth]).infer(problem)


STAGES: dict[str, Callable[[], None]] = {
    "features": _warm_up_features,
    "boosting": _warm_up_boosting,
    "scans": _warm_up_scans,
    "segments": _warm_up_segments,
    "space": _warm_up_space,
    "trees": _warm_up_trees,
    "relaxation": _warm_up_relaxation,
    "potts": _warm_up_potts,
    "amn": _warm_up_amn,
    "topology": _warm_up_topology,
}
"""What compiles the kernels of each stage or method, in the order of a comparison."""


if __name__ == "__main__":
    end_with_parent()
    main(sys.stdin)
