"""Grid search over options on held-out buildings or stripes of the training data."""

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
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.sources import Source, SourceDrive, Sources
from pgm_places.experiment.tasks import label_tests, learned, task_of, tests_of
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import Silent

# Most combinations; each is trained once per fold.
MOST_CANDIDATES = 200


@dataclass(frozen=True)
class SelectionCandidate:
    """A combination of options by dotted key, and its criterion on held-out nodes, also by fold."""

    options: dict[str, Any]
    score: float
    by_fold: tuple[float, ...]

    @property
    def spread(self) -> float:
        """Standard deviation over the folds; 0 for a single one."""
        return float(np.std(self.by_fold, ddof=1)) if len(self.by_fold) > 1 else 0.0


@dataclass(frozen=True)
class Selection:
    """All tried combinations of options; the first one with the best score is chosen."""

    method: str
    criterion: str
    candidates: tuple[SelectionCandidate, ...]

    @property
    def chosen(self) -> SelectionCandidate:
        """The best candidate."""
        return max(self.candidates, key=lambda candidate: candidate.score)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, ready for JSON."""
        return {
            "method": self.method,
            "criterion": self.criterion,
            "chosen": dict(self.chosen.options),
            "candidates": [
                {**asdict(each), "spread": each.spread, "by_fold": list(each.by_fold)}
                for each in self.candidates
            ],
        }


def selected_words(record: Mapping[str, Any] | None) -> dict[str, str]:
    """A text on the options chosen by a selection, with their score on held-out training data."""
    if record is None:
        return {}
    best = max(record["candidates"], key=lambda candidate: float(candidate["score"]))
    options = ", ".join(f"{key} = {value}" for key, value in record["chosen"].items())
    score = f"{100 * best['score']:.1f} ± {100 * best['spread']:.1f}"
    where = f"held-out {record['criterion'].replace('_', ' ')} of {record['method']}"
    return {"select": f"{options} ({where} {score}; {len(record['candidates'])} tried)"}


def select(experiment: Experiment, sources: Sources) -> Selection:
    """Train and evaluate each combination of the options in ``[select]`` on held-out folds.

    For steps of drives, methods are evaluated on held-out drives only. ConfigError if there are no
    combinations or too many, or an option does not exist; LabelError if no fold can be held out.
    """
    settings = experiment.config.select
    if settings is None:
        raise ConfigError("nothing to select: the configuration has no table [select]")
    candidates = _candidates(experiment.config, settings)
    if experiment.config.nodes == "both" and None in _building_folds(sources, settings.n_folds):
        raise ConfigError(
            "[select] with nodes = 'both' holds out buildings, but all training drives and maps "
            "are from one; add other buildings, or name the buildings with building"
        )
    method = settings.method or experiment.config.methods[-1].id
    splits = held_out_splits(sources, settings.n_folds, len(experiment.config.labels.names))
    tried = []
    with experiment.progress.stage("selection") as stage:
        for number, (options, config) in enumerate(candidates, start=1):
            methods = tuple(each for each in config.methods if each.id == method)
            reduced = replace(config, select=None, methods=methods)
            # Stages of a candidate's training are not reported or timed.
            trial = replace(experiment, config=reduced, progress=Silent(), seconds={})
            evaluations = [_score(trial, *split) for split in splits]
            score, *by_fold = (
                float(getattr(evaluation, settings.criterion))
                for evaluation in (Evaluation.merged(evaluations), *evaluations)
            )
            tried.append(SelectionCandidate(options, score, tuple(by_fold)))
            stage.update(number / len(candidates), f"{number} of {len(candidates)}")
    return Selection(method, settings.criterion, tuple(tried))


def held_out_splits(sources: Sources, n_folds: int, n_labels: int) -> list[tuple[Sources, Sources]]:
    """The training and test data of each fold; LabelError if no fold is left.

    Buildings are held out if there are several, otherwise stripes of the only one; not single cells
    or steps, because neighbours are alike. Folds without training examples of some label are
    skipped, and, if there are drives, folds without a held-out drive. Held-out nodes of a graph
    remain in its training graph, without labels.
    """
    labels = [_labels(item) for item in sources.all]
    known = [each >= 0 for each in labels]
    folds = _folds(sources, known, n_folds)
    fold_of = np.concatenate(folds)
    label_of = np.concatenate([each[mask] for each, mask in zip(labels, known, strict=True)])
    splits = []
    for fold in np.unique(fold_of):
        learn = _parts(sources, known, [each != fold for each in folds])
        test = _parts(sources, known, [each == fold for each in folds])
        learnable = len(np.unique(label_of[fold_of != fold])) == n_labels
        if learnable and (test.drives or not sources.drives):
            splits.append((learn, test))
    if not splits:
        raise LabelError(
            "no fold can be held out, because some label would have no training examples; label "
            "more, or use more folds"
        )
    return splits


def _labels(source: Source) -> NDArray[np.integer]:
    """The training label of each cell (H, W), step or node of a source, or -1."""
    if isinstance(source, LabelledMap):
        return np.where(source.labelled_cells, source.labels, np.int16(-1))
    return source.truth if isinstance(source, SourceGraph) else source.labels


def _folds(
    sources: Sources, known: Sequence[NDArray[np.bool_]], n_folds: int
) -> list[NDArray[np.int64]]:
    """The folds of the labelled cells of each map, steps of each drive, or nodes of each graph."""
    sizes, folds = [int(mask.sum()) for mask in known], _building_folds(sources, n_folds)
    if None not in folds:
        return [np.full(size, fold, np.int64) for size, fold in zip(sizes, folds, strict=True)]
    if sources.graphs:
        return [
            contiguous_parts(graph.problem.graph, n_folds, graph.truth)[mask]
            if fold is None
            else np.full(size, fold, np.int64)
            for graph, mask, size, fold in zip(sources.graphs, known, sizes, folds, strict=True)
        ]
    # Maps and drives have the same stripes, so that no drive is tested on a trained part of a map.
    places = [item.grid.cell_centres_m(np.argwhere(item.labelled_cells)) for item in sources.maps]
    places += [item.positions_m[item.labels >= 0] for item in sources.drives]
    return np.split(contiguous_blocks(np.concatenate(places), n_folds), np.cumsum(sizes)[:-1])


def _building_folds(sources: Sources, n_folds: int) -> list[int | None]:
    """The fold of each source by its building; None if there is only one building."""
    others = [source.building for source in sources.all if not isinstance(source, LabelledMap)]
    buildings = [*map_buildings(sources.maps), *others]
    return fold_of_buildings(buildings, n_folds)


def _parts(
    sources: Sources, known: Sequence[NDArray[np.bool_]], chosen: Sequence[NDArray[np.bool_]]
) -> Sources:
    """The sources restricted to the chosen labelled nodes, by windows of maps or by labels."""
    maps: list[LabelledMap] = []
    drives: list[SourceDrive] = []
    graphs: list[SourceGraph] = []
    for source, is_known, is_chosen in zip(sources.all, known, chosen, strict=True):
        mask = np.zeros(is_known.shape, np.bool_)
        mask[is_known] = is_chosen
        if not is_chosen.any():
            continue
        if isinstance(source, LabelledMap):
            maps.append(replace(source, window=mask))
        elif isinstance(source, SourceGraph):
            graphs.append(source.with_labels_at(mask))
        else:
            drives.append(source.with_labels_at(mask))
    return Sources(maps, drives, graphs)


def _candidates(
    config: ExperimentConfig, settings: SelectConfig
) -> list[tuple[dict[str, Any], ExperimentConfig]]:
    """All combinations of options with their configurations, checked before training."""
    number = math.prod(len(values) for values in settings.options.values())
    if number > MOST_CANDIDATES:
        raise ConfigError(
            f"[select] has {number} combinations of options; at most {MOST_CANDIDATES} are "
            "allowed; remove some"
        )
    every = [
        dict(zip(settings.options, values, strict=True))
        for values in product(*settings.options.values())
    ]
    return [(options, changed_config(config, options)) for options in every]


def _score(trial: Experiment, learn: Sources, held_out: Sources) -> Evaluation:
    """Train the only method of a configuration and evaluate it on held-out sources."""
    trained = learned(task_of(trial.config), trial, learn)
    labelled = label_tests(trained, tests_of(trial.config, held_out))
    [labelings] = labelled.labelings.values()
    evaluations = [
        evaluate(item.node_truth, labeling.labels, trained.label_names)
        for item, labeling in zip(labelled.items, labelings, strict=True)
    ]
    return Evaluation.merged(evaluations)
