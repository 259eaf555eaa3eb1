"""Compiling ahead: while a first run is at its early stages, a second process readies later ones.

A process compiles one kernel at a time, whatever its number of threads. So the second process runs
the later stages on a tiny map, and leaves their machine code in the cache that both share. A run
that comes to a kernel before the other is done with it compiles it itself.
"""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pgm_places.inference.problem import LabelingProblem

__all__ = ["REHEARSALS", "compiled_ahead", "main", "stage_of_model"]


@contextmanager
def compiled_ahead(stages: Sequence[str], *, n_threads: int | None = None) -> Iterator[None]:
    """Have those of the stages compiled elsewhere meanwhile that never were on this machine.

    Nothing is done where a single thread is wanted, or where no cache can be written.

    Parameters
    ----------
    stages : sequence of str
        Names of ``REHEARSALS``; others are passed over.
    n_threads : int, optional
        The threads that the run itself may use.
    """
    waiting = [name for name in stages if name in REHEARSALS and _is_new(name)]
    if not waiting or not sys.executable or _only_one(n_threads):
        yield
        return
    helper = subprocess.Popen(
        [sys.executable, "-m", "pgm_places.cli.ahead", *waiting],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield
    finally:
        helper.terminate()
        helper.wait()


def stage_of_model(folder: Path, method: str | None) -> str:
    """The backend of a stored model's method, its last one for None; "" where that is not clear.

    The model is not loaded, which takes longer than it takes the second process to start.
    """
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        backends = {item["name"]: item["backend"] for item in manifest["content"]["methods"]}
        return str(backends[method or list(backends)[-1]])
    except (OSError, ValueError, LookupError, TypeError):
        return ""  # what is wrong with the model shows when it is loaded


def main(stages: Sequence[str]) -> None:
    """Go through the stages, and note down each so that it is not gone through again."""
    for name in stages:
        REHEARSALS[name]()
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
    """The file that says that a stage has been compiled, by this Python and this compiler."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return None
    from importlib.metadata import version

    from pgm_places.kernels.cache import cache_folder

    folder = cache_folder()
    if folder is None:
        return None
    return folder / f"{name}-python{platform.python_version()}-numba{version('numba')}"


def _rehearse_features() -> None:
    """The families that come last and take longest; the run itself comes to the others first."""
    import numpy as np

    from pgm_places.features.extraction import extract
    from pgm_places.features.laser import laser_feature_names

    families = {"f16", "f17", "f18", "f19"}
    names = [name.partition("_")[0] for name in laser_feature_names()]
    columns = [column for column, family in enumerate(names) if family in families]
    extract(np.ones((1, 360), np.float32), max_range_m=10.0, columns=columns)


def _rehearse_topology() -> None:
    from pgm_places.datasets import generate_building
    from pgm_places.topology.from_labels import topological_map

    building = generate_building(size="small")
    topological_map(building.grid, building.labels, building.label_names)


def _blank_problem() -> "LabelingProblem":
    """A grid of 4 x 4 cells and three labels, of which none is better."""
    import numpy as np

    from pgm_places.graph.label_graph import LabelGraph
    from pgm_places.inference.problem import LabelingProblem
    from pgm_places.maps.occupancy_grid import OccupancyGrid

    graph = LabelGraph.from_grid(OccupancyGrid(np.zeros((4, 4), np.int8), 1.0))
    return LabelingProblem(graph, ("a", "b", "c"), unary=np.zeros((16, 3)))


def _rehearse_relaxation() -> None:
    import numpy as np

    from pgm_places.models.relaxation import Relaxation

    problem = _blank_problem()
    Relaxation().fit([problem], [np.arange(16) % 3]).infer(problem)


def _rehearse_potts() -> None:
    """Mean field, as the shipped models use it."""
    from pgm_places.models.mrf import PottsField

    PottsField(inference="mean-field").infer(_blank_problem())


def _rehearse_boosting() -> None:
    import numpy as np

    from pgm_places.models.decision_list import DecisionListClassifier

    rng = np.random.default_rng(0)
    features = rng.random((300, 8), np.float32)
    truth = np.arange(300) % 3
    groups = np.arange(300) // 60
    fitted = DecisionListClassifier(n_rounds=3).fit(features, truth, groups=groups)
    fitted.boosted_list_.log_histogram(features)


def _rehearse_amn() -> None:
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


REHEARSALS: dict[str, Callable[[], None]] = {
    "features": _rehearse_features,
    "boosting": _rehearse_boosting,
    "relaxation": _rehearse_relaxation,
    "potts": _rehearse_potts,
    "amn": _rehearse_amn,
    "topology": _rehearse_topology,
}
"""What is done with the kernels of each stage or method; in the order of a comparison."""


if __name__ == "__main__":
    main(sys.argv[1:])
