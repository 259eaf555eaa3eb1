"""Detecting overlap of training and test data."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.source_config import SourceConfig
from pgm_places.experiment.sources import Source
from pgm_places.maps.labelled_map import LabelledMap

_WHOLES = {"cell": "maps", "step": "drives", "node": "graphs"}
"""What nodes are part of."""

MOST_NAMES = 3
"""Names that a warning lists; of more it gives their number."""


@dataclass(frozen=True, eq=False)
class _Nodes:
    """The labelled nodes of a map, a drive or a graph.

    Parameters
    ----------
    name : str
    unit : str
        ``cell``, ``step`` or ``node``.
    whole : str
        What they are part of, by its content: nodes of another whole are other nodes.
    labelled : (n,)
        What tells them from each other there.
    """

    name: str
    unit: str
    whole: str
    labelled: NDArray[np.generic]


def warn_of_overlap(
    experiment: Experiment, train: Sequence[Source], test: Sequence[Source]
) -> None:
    """One line for nodes that are trained and tested on, and one for buildings.

    Nodes are the same where the raster, the steps or the graph are, whatever their files are
    called. A building counts where the configuration names it, or where maps of one plan differ;
    parts of one raster may be trained and tested on.
    """
    joined = experiment.config.nodes == "both"
    learned, asked = (
        [part for item in sources for part in _labelled_nodes(item, joined)]
        for sources in (train, test)
    )
    for unit in _WHOLES:
        _warn_of_nodes(experiment, unit, learned, asked)
    _warn_of_buildings(experiment, train, test)


def _warn_of_nodes(
    experiment: Experiment, unit: str, learned: Sequence[_Nodes], asked: Sequence[_Nodes]
) -> None:
    shared, total, names = 0, 0, []
    for item in asked:
        if item.unit != unit:
            continue
        seen = [other.labelled for other in learned if other.whole == item.whole]
        count = int(np.isin(item.labelled, np.concatenate(seen)).sum()) if seen else 0
        shared, total = shared + count, total + len(item.labelled)
        names += [item.name] if count else []
    if shared:
        experiment.warn(
            f"{shared:,} of {total:,} labelled test {unit}s are also trained on "
            f"({_listed(names)}): figures on them say nothing about new {_WHOLES[unit]}; test on "
            "others, or on other parts of these"
        )


def _warn_of_buildings(
    experiment: Experiment, train: Sequence[Source], test: Sequence[Source]
) -> None:
    config = experiment.config
    named = {_named_building(item) for item in config.train}
    named &= {_named_building(item) for item in config.test}
    both = [str(item.building) for item in test if item.building in named - {None}]
    for item in test:
        for other in train:
            if not isinstance(item, LabelledMap) or not isinstance(other, LabelledMap):
                continue
            if item.building == other.building and _raster(item) != _raster(other):
                both.append(str(item.building))
    if both:
        experiment.warn(
            f"[[train]] and [[test]] share a building ({_listed(both)}): figures say little about "
            "other buildings; test in another one"
        )


def _named_building(source: SourceConfig) -> str | None:
    """The building that a configuration gives to a source."""
    return source.building or (source.drive.building if source.drive else None)


def _labelled_nodes(item: Source, joined: bool) -> list[_Nodes]:
    """Those of a source; of a drive also the cells of its map, where both are labelled."""
    if isinstance(item, LabelledMap):
        cells = np.flatnonzero(item.labelled_cells)
        return [_Nodes(item.name, "cell", _raster(item), cells)]
    if isinstance(item, SourceGraph):
        problem = item.problem
        arrays = (problem.graph.edges, problem.node_features, problem.unary, problem.edge_features)
        whole = _digest(*(part for part in arrays if part is not None))
        return [_Nodes(item.name, "node", whole, np.flatnonzero(item.truth >= 0))]
    # Steps are identified by their time and pose, so that parts of one log are recognised.
    drive, known = item.trajectory, item.labels >= 0
    rows = np.column_stack([drive.times_s, drive.poses])[known]
    steps = _Nodes(drive.name, "step", "", np.array([_digest(row) for row in rows]))
    return [steps, *(_labelled_nodes(item.map, joined) if joined and item.map is not None else [])]


def _raster(item: LabelledMap) -> str:
    return _digest(item.grid.cells)


def _digest(*arrays: NDArray[np.generic]) -> str:
    """A text that is the same for equal arrays alone."""
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(f"{array.shape} {array.dtype}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _listed(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    shown = ", ".join(distinct[:MOST_NAMES])
    more = len(distinct) - MOST_NAMES
    return f"{shown} and {more} more" if more > 0 else shown
