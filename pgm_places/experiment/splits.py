"""Splits of the training data into training and test buildings."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Self

from pgm_places.errors import ConfigError, nearest_name
from pgm_places.evaluation.folds import fold_of_buildings
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.source_config import SourceConfig, SplitConfig
from pgm_places.experiment.sources import load_sources
from pgm_places.experiment.tasks import TASKS, tests_of


@dataclass(frozen=True, eq=False)
class Split:
    """A split of the training data.

    Parameters
    ----------
    name : str
        Its name in tables.
    config : ExperimentConfig
        Configuration with the training and test data of the split.
    """

    name: str
    config: ExperimentConfig


def splits_of(experiment: Experiment, *, n_folds: int | None = None) -> list[Split]:
    """The splits listed by the configuration, or splits that hold out each building in turn.

    Parameters
    ----------
    experiment : Experiment
    n_folds : int, optional
        Number of groups of buildings to hold out; by default each building is one. Not for a
        configuration that lists its splits.

    Raises
    ------
    ConfigError
        A listed split names an unknown building, or has no training data. Without listed splits:
        all test data are from one building, or there are more folds than buildings.
    """
    known = _Buildings.of(experiment)
    listed = experiment.config.splits
    if listed:
        return [known.listed(number, item) for number, item in enumerate(listed)]
    return known.folds(n_folds)


@dataclass(frozen=True, eq=False)
class _Buildings:
    """The training data of a configuration by building.

    Parameters
    ----------
    config : ExperimentConfig
    sources : sequence of (SourceConfig, str or None, bool)
        Sources with building, and whether they can be test data.
    tested : sequence of str
        The buildings of possible test data.
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
