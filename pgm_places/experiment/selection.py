"""Grid search over options on the training maps and drives, holding out buildings or stripes."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, LabelError
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.evaluation.folds import contiguous_blocks, fold_of_buildings, map_buildings
from pgm_places.experiment.config import ExperimentConfig, SelectConfig
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graph_task import graph_splits
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.tasks import label_names, label_tests, task_of, tests_of
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import Silent

__all__ = ["Candidate", "Selection", "held_out_splits", "select"]

MOST_CANDIDATES = 200
"""More combinations than this are probably a mistake: each is learned once per fold."""


@dataclass(frozen=True)
class Candidate:
    """A combination of options and its score on held-out cells or steps.

    Parameters
    ----------
    options : dict
        Values by dotted key.
    score : float
        The criterion over the held-out nodes of all folds together.
    by_fold : tuple of float
        The criterion of each fold.
    """

    options: dict[str, Any]
    score: float
    by_fold: tuple[float, ...]

    @property
    def spread(self) -> float:
        """Standard deviation over the folds; 0 for a single one."""
        return float(np.std(self.by_fold, ddof=1)) if len(self.by_fold) > 1 else 0.0


@dataclass(frozen=True)
class Selection:
    """All combinations tried; the first one with the best score is chosen."""

    method: str
    criterion: str
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> Candidate:
        """The best."""
        return max(self.candidates, key=lambda item: item.score)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, ready for JSON."""
        return {
            "method": self.method,
            "criterion": self.criterion,
            "chosen": dict(self.chosen.options),
            "candidates": [
                {**asdict(item), "spread": item.spread, "by_fold": list(item.by_fold)}
                for item in self.candidates
            ],
        }


def select(experiment: Experiment, sources: Sources) -> Selection:
    """The options of ``[select]``, each combination trained and tested on held-out folds.

    Parameters
    ----------
    experiment : Experiment
        Its configuration has a table ``[select]``.
    sources : Sources
        The training maps and drives; test data are never looked at. Where steps are labelled,
        methods are scored on held-out drives alone.

    Raises
    ------
    ConfigError
        There are no combinations or far too many, or an option does not exist.
    LabelError
        No fold can be held out.
    """
    settings = experiment.config.select
    if settings is None:
        raise ConfigError("nothing to select: the configuration has no table [select]")
    candidates = _candidates(experiment.config, settings)
    if experiment.config.nodes == "both" and None in _building_folds(sources, settings.n_folds):
        raise ConfigError(
            "[select] with nodes = 'both' holds out whole buildings, but all training drives and "
            "maps are of one; add those of others, or tell them apart with building"
        )
    method = settings.method or experiment.config.methods[-1].id
    splits = held_out_splits(sources, settings.n_folds, len(experiment.config.labels.names))
    tried = []
    with experiment.progress.stage("selection") as stage:
        for number, (options, config) in enumerate(candidates, start=1):
            alone = tuple(item for item in config.methods if item.id == method)
            kept = replace(config, select=None, methods=alone)
            # The stages of a candidate's training are no stages of the experiment.
            trial = replace(experiment, config=kept, progress=Silent(), seconds={})
            parts = [_score(trial, *split) for split in splits]
            whole, *figures = (
                float(getattr(part, settings.criterion))
                for part in (Evaluation.merged(parts), *parts)
            )
            tried.append(Candidate(options, whole, tuple(figures)))
            stage.update(number / len(candidates), f"{number} of {len(candidates)}")
    return Selection(method, settings.criterion, tuple(tried))


def held_out_splits(sources: Sources, n_folds: int, n_labels: int) -> list[tuple[Sources, Sources]]:
    """The training and test data of each fold.

    Whole buildings are held out if there are several, otherwise stripes of the only one; never
    single cells or steps, because neighbours look alike. Folds that leave some label without
    training examples are skipped, and where there are drives, so are those that hold none of them
    out.

    Raises
    ------
    LabelError
        No fold is left.
    """
    if sources.graphs:
        parts = graph_splits(sources.graphs, n_folds, n_labels)
        splits = [(Sources(graphs=learn), Sources(graphs=test)) for learn, test in parts]
    else:
        splits = list(_splits(sources, n_folds, n_labels))
    if not splits:
        raise LabelError(
            "no fold can be held out: each one leaves some label without examples; label more, or "
            "use more folds"
        )
    return splits


def _splits(sources: Sources, n_folds: int, n_labels: int) -> Iterator[tuple[Sources, Sources]]:
    """Those of maps and drives."""
    fold_of, labels = _folds(sources, n_folds), np.concatenate(_labels(sources))
    every = np.concatenate(fold_of)
    for fold in np.unique(every):
        test = _parts(sources, [numbers == fold for numbers in fold_of])
        learnable = len(np.unique(labels[every != fold])) == n_labels
        if learnable and (test.drives or not sources.drives):
            yield _parts(sources, [numbers != fold for numbers in fold_of]), test


def _folds(sources: Sources, n_folds: int) -> list[NDArray[np.int64]]:
    """The folds of the labelled cells of each map and of the labelled steps of each drive."""
    sizes = [len(item) for item in _labels(sources)]
    folds = _building_folds(sources, n_folds)
    if None not in folds:
        return [np.full(size, fold, np.int64) for size, fold in zip(sizes, folds, strict=True)]
    # The same stripes for maps and drives, so that no drive is tested where its map was learned.
    places = [item.grid.cell_centres_m(np.argwhere(item.labelled_cells)) for item in sources.maps]
    places += [item.positions_m[item.labels >= 0] for item in sources.drives]
    return np.split(contiguous_blocks(np.concatenate(places), n_folds), np.cumsum(sizes)[:-1])


def _building_folds(sources: Sources, n_folds: int) -> list[int | None]:
    """The fold of each map and drive by its building; None where there is only one."""
    buildings = [*map_buildings(sources.maps), *(item.building for item in sources.drives)]
    return fold_of_buildings(buildings, n_folds)


def _labels(sources: Sources) -> list[NDArray[np.int64]]:
    """The known labels of the cells of each map and of the steps of each drive."""
    of_maps = [item.labels[item.labelled_cells].astype(np.int64) for item in sources.maps]
    return [*of_maps, *(item.labels[item.labels >= 0] for item in sources.drives)]


def _parts(sources: Sources, chosen: Sequence[NDArray[np.bool_]]) -> Sources:
    """Maps with windows, and drives with labels, reduced to the chosen cells and steps."""
    n_maps = len(sources.maps)
    maps = [
        _windowed(item, item.labelled_cells, kept)
        for item, kept in zip(sources.maps, chosen[:n_maps], strict=True)
        if kept.any()
    ]
    drives = [
        item.with_labels_at(np.flatnonzero(item.labels >= 0)[kept])
        for item, kept in zip(sources.drives, chosen[n_maps:], strict=True)
        if kept.any()
    ]
    return Sources(maps, drives)


def _windowed(item: LabelledMap, cells: NDArray[np.bool_], kept: NDArray[np.bool_]) -> LabelledMap:
    window = np.zeros(item.grid.shape, np.bool_)
    window[cells] = kept
    return replace(item, window=window)


def _candidates(
    config: ExperimentConfig, settings: SelectConfig
) -> list[tuple[dict[str, Any], ExperimentConfig]]:
    """All combinations of options with their configurations, checked before anything is learned."""
    number = math.prod(len(values) for values in settings.options.values())
    if number > MOST_CANDIDATES:
        raise ConfigError(
            f"[select] has {number} combinations of options; at most {MOST_CANDIDATES} are "
            "allowed, so leave some out"
        )
    every = [
        dict(zip(settings.options, values, strict=True))
        for values in product(*settings.options.values())
    ]
    return [(options, changed_config(config, options)) for options in every]


def _score(trial: Experiment, learn: Sources, held_out: Sources) -> Evaluation:
    """The one method of a configuration, trained on some sources and scored on others."""
    labelers = task_of(trial.config).learn(trial, learn)
    labelled = label_tests(trial, labelers, tests_of(trial.config, held_out))
    [labelings] = labelled.labelings.values()
    parts = [
        evaluate(item.node_truth, labeling.labels, label_names(labelers))
        for item, labeling in zip(labelled.items, labelings, strict=True)
    ]
    return Evaluation.merged(parts)
