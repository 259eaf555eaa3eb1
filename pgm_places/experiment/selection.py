"""Grid search over options on the training maps and drives, holding out buildings or stripes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, LabelError
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.evaluation.folds import (
    contiguous_blocks,
    contiguous_parts,
    fold_of_buildings,
    map_buildings,
)
from pgm_places.experiment.config import ExperimentConfig, SelectConfig
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.drives import SourceDrive
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.sources import Source, Sources
from pgm_places.experiment.tasks import label_tests, learned, task_of, tests_of
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import Silent

# More combinations than this are probably a mistake: each is learned once per fold.
MOST_CANDIDATES = 200


@dataclass(frozen=True)
class SelectionCandidate:
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
    candidates: tuple[SelectionCandidate, ...]

    @property
    def chosen(self) -> SelectionCandidate:
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


def selected_words(record: Mapping[str, Any] | None) -> dict[str, str]:
    """The options chosen by a selection, with their score on held-out training data, in words."""
    if record is None:
        return {}
    best = max(record["candidates"], key=lambda item: float(item["score"]))
    options = ", ".join(f"{key} = {value}" for key, value in record["chosen"].items())
    score = f"{100 * best['score']:.1f} ± {100 * best['spread']:.1f}"
    where = f"held-out {record['criterion'].replace('_', ' ')} of {record['method']}"
    return {"select": f"{options} ({where} {score}; {len(record['candidates'])} tried)"}


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
            tried.append(SelectionCandidate(options, whole, tuple(figures)))
            stage.update(number / len(candidates), f"{number} of {len(candidates)}")
    return Selection(method, settings.criterion, tuple(tried))


def held_out_splits(sources: Sources, n_folds: int, n_labels: int) -> list[tuple[Sources, Sources]]:
    """The training and test data of each fold.

    Whole buildings are held out if there are several, otherwise stripes of the only one; never
    single cells or steps, because neighbours look alike. Folds that leave some label without
    training examples are skipped, and where there are drives, so are those that hold none of them
    out. Nodes of a graph that are held out stay in the one that is learned from, without labels.

    Raises
    ------
    LabelError
        No fold is left.
    """
    labels = [_labels(item) for item in sources.all]
    known = [part >= 0 for part in labels]
    folds = _folds(sources, known, n_folds)
    fold_of = np.concatenate(folds)
    label_of = np.concatenate([part[some] for part, some in zip(labels, known, strict=True)])
    splits = []
    for fold in np.unique(fold_of):
        learn = _parts(sources, known, [part != fold for part in folds])
        test = _parts(sources, known, [part == fold for part in folds])
        learnable = len(np.unique(label_of[fold_of != fold])) == n_labels
        if learnable and (test.drives or not sources.drives):
            splits.append((learn, test))
    if not splits:
        raise LabelError(
            "no fold can be held out: each one leaves some label without examples; label more, or "
            "use more folds"
        )
    return splits


def _labels(item: Source) -> NDArray[np.integer]:
    """The label of each cell (H, W), step or node of a source, -1 where none is to be learned."""
    if isinstance(item, LabelledMap):
        return np.where(item.labelled_cells, item.labels, np.int16(-1))
    return item.truth if isinstance(item, SourceGraph) else item.labels


def _folds(
    sources: Sources, known: Sequence[NDArray[np.bool_]], n_folds: int
) -> list[NDArray[np.int64]]:
    """The folds of the labelled cells of each map, steps of each drive, or nodes of each graph."""
    sizes, folds = [int(part.sum()) for part in known], _building_folds(sources, n_folds)
    if None not in folds:
        return [np.full(size, fold, np.int64) for size, fold in zip(sizes, folds, strict=True)]
    if sources.graphs:
        return [
            contiguous_parts(item.problem.graph, n_folds, item.truth)[some]
            if fold is None
            else np.full(size, fold, np.int64)
            for item, some, size, fold in zip(sources.graphs, known, sizes, folds, strict=True)
        ]
    # The same stripes for maps and drives, so that no drive is tested where its map was learned.
    places = [item.grid.cell_centres_m(np.argwhere(item.labelled_cells)) for item in sources.maps]
    places += [item.positions_m[item.labels >= 0] for item in sources.drives]
    return np.split(contiguous_blocks(np.concatenate(places), n_folds), np.cumsum(sizes)[:-1])


def _building_folds(sources: Sources, n_folds: int) -> list[int | None]:
    """The fold of each source by its building; None where there is only one."""
    others = [item.building for item in sources.all if not isinstance(item, LabelledMap)]
    buildings = [*map_buildings(sources.maps), *others]
    return fold_of_buildings(buildings, n_folds)


def _parts(
    sources: Sources, known: Sequence[NDArray[np.bool_]], chosen: Sequence[NDArray[np.bool_]]
) -> Sources:
    """Maps with windows, others with labels, reduced to the chosen of their labelled nodes."""
    maps: list[LabelledMap] = []
    drives: list[SourceDrive] = []
    graphs: list[SourceGraph] = []
    for item, some, kept in zip(sources.all, known, chosen, strict=True):
        mask = np.zeros(some.shape, np.bool_)
        mask[some] = kept
        if not kept.any():
            continue
        if isinstance(item, LabelledMap):
            maps.append(replace(item, window=mask))
        elif isinstance(item, SourceGraph):
            graphs.append(item.with_labels_at(mask))
        else:
            drives.append(item.with_labels_at(mask))
    return Sources(maps, drives, graphs)


def _candidates(
    config: ExperimentConfig, settings: SelectConfig
) -> list[tuple[dict[str, object], ExperimentConfig]]:
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
    trained = learned(task_of(trial.config), trial, learn)
    labelled = label_tests(trained, tests_of(trial.config, held_out))
    [labelings] = labelled.labelings.values()
    parts = [
        evaluate(item.node_truth, labeling.labels, trained.label_names)
        for item, labeling in zip(labelled.items, labelings, strict=True)
    ]
    return Evaluation.merged(parts)
