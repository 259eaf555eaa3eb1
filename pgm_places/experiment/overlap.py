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

_SOURCES = {"cell": "maps", "step": "drives", "node": "graphs"}
"""The kind of source of each kind of node."""

MOST_NAMES = 3
"""Most names in a warning."""


@dataclass(frozen=True, eq=False)
class _Nodes:
    """The labelled nodes of a source: their kind, a digest of the source, and their ids in it."""

    name: str
    unit: str
    source: str
    ids: NDArray[np.generic]


def warn_of_overlap(
    experiment: Experiment, train: Sequence[Source], test: Sequence[Source]
) -> None:
    """Warn of nodes and of buildings that are both in the training and in the test data.

    Nodes are identified by the content of the raster, the steps or the graph, not by file names.
    Buildings are compared if the configuration names them, or for different maps of one plan;
    parts of one raster may be in both.
    """
    joined = experiment.config.nodes == "both"
    trained, tested = (
        [nodes for source in sources for nodes in _labelled_nodes(source, joined)]
        for sources in (train, test)
    )
    for unit in _SOURCES:
        _warn_of_nodes(experiment, unit, trained, tested)
    _warn_of_buildings(experiment, train, test)


def _warn_of_nodes(
    experiment: Experiment, unit: str, trained: Sequence[_Nodes], tested: Sequence[_Nodes]
) -> None:
    shared, total, names = 0, 0, []
    for nodes in tested:
        if nodes.unit != unit:
            continue
        others = [other.ids for other in trained if other.source == nodes.source]
        count = int(np.isin(nodes.ids, np.concatenate(others)).sum()) if others else 0
        shared, total = shared + count, total + len(nodes.ids)
        names += [nodes.name] if count else []
    if shared:
        experiment.warn(
            f"{shared:,} of {total:,} labelled test {unit}s are also trained on "
            f"({_listed(names)}): results on them are over-optimistic; test on other "
            f"{_SOURCES[unit]}, or on other parts of these"
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
            f"[[train]] and [[test]] share a building ({_listed(both)}): results are "
            "over-optimistic for other buildings; test in another building"
        )


def _named_building(source: SourceConfig) -> str | None:
    """The building of a source in the configuration, or None."""
    return source.building or (source.drive.building if source.drive else None)


def _labelled_nodes(item: Source, joined: bool) -> list[_Nodes]:
    """The labelled nodes of a source; for a drive labelled with its map, also the map's cells."""
    if isinstance(item, LabelledMap):
        cells = np.flatnonzero(item.labelled_cells)
        return [_Nodes(item.name, "cell", _raster(item), cells)]
    if isinstance(item, SourceGraph):
        problem = item.problem
        arrays = (problem.graph.edges, problem.node_features, problem.unary, problem.edge_features)
        digest = _digest(*(array for array in arrays if array is not None))
        return [_Nodes(item.name, "node", digest, np.flatnonzero(item.truth >= 0))]
    # Steps are identified by their time and pose, so that parts of one log are recognised.
    drive, known = item.trajectory, item.labels >= 0
    rows = np.column_stack([drive.times_s, drive.poses])[known]
    steps = _Nodes(drive.name, "step", "", np.array([_digest(row) for row in rows]))
    return [steps, *(_labelled_nodes(item.map, joined) if joined and item.map is not None else [])]


def _raster(item: LabelledMap) -> str:
    return _digest(item.grid.cells)


def _digest(*arrays: NDArray[np.generic]) -> str:
    """A hash of arrays."""
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
