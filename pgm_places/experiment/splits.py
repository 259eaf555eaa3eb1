"""Splits of the training data by building, and overlap of training and test data."""

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, nearest_name
from pgm_places.evaluation.folds import fold_of_buildings
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.source_config import SourceConfig, SplitConfig
from pgm_places.experiment.sources import Source, load_sources
from pgm_places.experiment.tasks import TASKS, tests_of
from pgm_places.maps.labelled_map import LabelledMap


@dataclass(frozen=True, eq=False)
class Split:
    """A split of the training data: its name in tables, and a configuration with its data."""

    name: str
    config: ExperimentConfig


def splits_of(experiment: Experiment, *, n_folds: int | None = None) -> list[Split]:
    """The splits listed by the configuration, or splits that hold out each building in turn.

    Unless splits are listed, ``n_folds`` groups of buildings are held out. ConfigError for an
    unknown building, a split without training data, a single building, or more folds than
    buildings.
    """
    known = _Buildings.of(experiment)
    listed = experiment.config.splits
    if listed:
        return [known.listed(number, item) for number, item in enumerate(listed)]
    return known.folds(n_folds)


@dataclass(frozen=True, eq=False)
class _Buildings:
    """The training data of a configuration: sources with building, and whether they can be tests.

    ``tested`` are the buildings of possible test data.
    """

    config: ExperimentConfig
    sources: Sequence[tuple[SourceConfig, str | None, bool]]
    tested: Sequence[str]

    @classmethod
    def of(cls, experiment: Experiment) -> Self:
        """Load the training data, because files may name their building."""
        config, loaded = experiment.config, load_sources(experiment, "train")
        maps, others = iter(loaded.maps), iter(loaded.all[len(loaded.maps) :])
        sources = []
        for item in config.train:
            is_other = item.is_drive or item.graph is not None
            building = (next(others) if is_other else next(maps)).building
            # For steps of drives, maps are only training data; drives can be test data.
            sources.append((item, building, is_other == (config.nodes != "cells")))
        tested = dict.fromkeys(str(item.building) for item in tests_of(config, loaded))
        return cls(config, sources, list(tested))

    def folds(self, n_folds: int | None) -> list[Split]:
        """Splits that hold out each building, or groups of buildings."""
        n_buildings, wanted = len(self.tested), n_folds or len(self.tested)
        if n_buildings < 2:
            kind = TASKS[self.config.nodes].tested
            table = ", or buildings = 'table.csv'" if kind == "maps" else ""
            raise ConfigError(
                f"holding out buildings needs {kind} of at least two buildings in [[train]]; name "
                f"the building of each {kind.removesuffix('s')}: building = '...'{table}"
            )
        if wanted > n_buildings:
            raise ConfigError(
                f"{wanted} folds need at least {wanted} buildings in [[train]], which has "
                f"{n_buildings}; use at most {n_buildings} folds"
            )
        numbers = fold_of_buildings(self.tested, wanted)
        splits = []
        for fold in range(wanted):
            held_out = [name for name, of in zip(self.tested, numbers, strict=True) if of == fold]
            name = held_out[0] if wanted == n_buildings else f"fold {fold + 1}"
            splits.append(self._split(name, held_out, None))
        return splits

    def listed(self, number: int, item: SplitConfig) -> Split:
        """A split listed by the configuration."""
        every = [str(building) for _, building, _ in self.sources]
        for part, names in (("test", item.test), ("train", item.train or ())):
            allowed = list(dict.fromkeys(every)) if part == "train" else list(self.tested)
            for name in names:
                if name not in allowed:
                    raise ConfigError(
                        f"splits[{number}].{part}: no building {name!r} in [[train]] to {part} on. "
                        f"{nearest_name(name, allowed)}"
                    )
        if item.train is None and set(every) <= set(item.test):
            raise ConfigError(
                f"splits[{number}].test has all buildings, which leaves none to train on"
            )
        return self._split(item.name or " + ".join(item.test), item.test, item.train)

    def _split(self, name: str, test: Collection[str], train: Collection[str] | None) -> Split:
        trained = [
            source
            for source, building, _ in self.sources
            if (str(building) not in test if train is None else str(building) in train)
        ]
        tested = [
            source
            for source, building, is_testable in self.sources
            if is_testable and str(building) in test
        ]
        config = replace(self.config, splits=(), train=tuple(trained), test=tuple(tested))
        return Split(name, config)


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

    Nodes are identified by content, not by file names. Buildings are compared if the configuration
    names them, or for different maps of one plan.
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
