"""Splits of the training data into what is learned from and what is tested on, by building."""

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
    """A part of the training data to test on.

    Parameters
    ----------
    name : str
        Its name in tables.
    config : ExperimentConfig
        Trains on one part and tests on the other.
    """

    name: str
    config: ExperimentConfig


def splits_of(experiment: Experiment, *, n_folds: int | None = None) -> list[Split]:
    """The splits that the configuration lists, or whole buildings held out in turn.

    Parameters
    ----------
    experiment : Experiment
    n_folds : int, optional
        Buildings are held out in that many groups; by default each one by itself. Not for a
        configuration that lists its splits.

    Raises
    ------
    ConfigError
        A listed split names no building of the training data, or leaves nothing to learn from;
        otherwise, all that can be tested on is of one building, or there are more folds than
        buildings.
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
        Each with its building, and whether it can be tested on.
    tested : sequence of str
        The buildings that can be tested on.
    """

    config: ExperimentConfig
    sources: Sequence[tuple[SourceConfig, str | None, bool]]
    tested: Sequence[str]

    @classmethod
    def of(cls, experiment: Experiment) -> Self:
        """Read as configured: a file may say of which building it is."""
        config, loaded = experiment.config, load_sources(experiment, "train")
        maps, others = iter(loaded.maps), iter(loaded.all[len(loaded.maps) :])
        sources = []
        for item in config.train:
            is_other = item.is_drive or item.graph is not None
            building = (next(others) if is_other else next(maps)).building
            # Where steps are labelled, maps are learned from and drives are tested on, too.
            sources.append((item, building, is_other == (config.nodes != "cells")))
        tested = dict.fromkeys(str(item.building) for item in tests_of(config, loaded))
        return cls(config, sources, list(tested))

    def folds(self, n_folds: int | None) -> list[Split]:
        """Each building held out in turn, or groups of them."""
        n_buildings, wanted = len(self.tested), n_folds or len(self.tested)
        if n_buildings < 2:
            kind = TASKS[self.config.nodes].tested
            table = ", or buildings = 'table.csv'" if kind == "maps" else ""
            raise ConfigError(
                f"holding buildings out needs {kind} of two buildings in [[train]], and there is "
                f"one; name the building of each {kind.removesuffix('s')}: building = '...'{table}"
            )
        if wanted > n_buildings:
            raise ConfigError(
                f"{wanted} folds by building need as many buildings in [[train]], and there are "
                f"{n_buildings}; ask for at most {n_buildings}"
            )
        numbers = fold_of_buildings(self.tested, wanted)
        splits = []
        for fold in range(wanted):
            held_out = [name for name, of in zip(self.tested, numbers, strict=True) if of == fold]
            name = held_out[0] if wanted == n_buildings else f"fold {fold + 1}"
            splits.append(self._split(name, held_out, None))
        return splits

    def listed(self, number: int, item: SplitConfig) -> Split:
        """A split that the configuration lists."""
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
                f"splits[{number}].test holds all buildings out, which leaves none to learn from"
            )
        return self._split(item.name or " + ".join(item.test), item.test, item.train)

    def _split(self, name: str, test: Collection[str], train: Collection[str] | None) -> Split:
        learned = [
            item
            for item, of, _ in self.sources
            if (str(of) not in test if train is None else str(of) in train)
        ]
        asked = [item for item, of, can_be in self.sources if can_be and str(of) in test]
        return Split(name, replace(self.config, splits=(), train=tuple(learned), test=tuple(asked)))
