"""Grid search over options on the training maps, holding out buildings or contiguous blocks."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, LabelError
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.evaluation.folds import building_folds
from pgm_places.experiment.config import ExperimentConfig, SelectConfig
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.setup import make_labeler
from pgm_places.maps.labelled_map import LabelledMap

__all__ = ["Candidate", "Selection", "held_out_splits", "select"]

MOST_CANDIDATES = 200
"""More combinations than this are probably a mistake: each is learned once per fold."""


@dataclass(frozen=True)
class Candidate:
    """A combination of options and its score on held-out cells.

    Parameters
    ----------
    options : dict
        Values by dotted key.
    score : float
        The criterion over the held-out cells of all folds together.
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
    """All combinations tried; the chosen one has the best score, the first in case of ties."""

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
                {
                    "options": dict(item.options),
                    "score": item.score,
                    "spread": item.spread,
                    "by_fold": list(item.by_fold),
                }
                for item in self.candidates
            ],
        }


def select(experiment: Experiment, maps: Sequence[LabelledMap]) -> Selection:
    """The options of ``[select]``, each combination learned and tested on held-out folds.

    Parameters
    ----------
    experiment : Experiment
        Its configuration has a table ``[select]``.
    maps : sequence of LabelledMap
        The training maps; test maps are never looked at.

    Raises
    ------
    ConfigError
        There is nothing to choose from or far too much, or an option does not exist.
    LabelError
        Every fold leaves some label without training examples.
    """
    settings = experiment.config.select
    if settings is None:
        raise ConfigError("nothing to select: the configuration has no table [select]")
    candidates = _candidates(experiment.config, settings)
    method = settings.method or experiment.config.methods[-1].id
    splits = list(held_out_splits(maps, settings.n_folds, len(experiment.config.labels.names)))
    found = []
    with experiment.progress.stage("selection") as stage:
        for number, (options, config) in enumerate(candidates, start=1):
            parts = [_scored(experiment, config, method, *split) for split in splits]
            figures = [float(getattr(part, settings.criterion)) for part in parts]
            whole = float(getattr(Evaluation.merged(parts), settings.criterion))
            found.append(Candidate(options, whole, tuple(figures)))
            stage.update(number / len(candidates), f"{number} of {len(candidates)}")
    return Selection(method, settings.criterion, tuple(found))


def held_out_splits(
    maps: Sequence[LabelledMap], n_folds: int, n_labels: int
) -> Iterator[tuple[list[LabelledMap], list[LabelledMap]]]:
    """Training maps and test maps, fold by fold.

    Whole buildings are held out if there are several, else contiguous blocks of the only one, never
    single cells, because neighbours look alike. Folds that leave some label without training
    examples are skipped.

    Raises
    ------
    LabelError
        This is the case for every fold.
    """
    masks = [item.labelled_cells for item in maps]
    sizes = [int(mask.sum()) for mask in masks]
    fold_of = np.split(building_folds(maps, masks, n_folds), np.cumsum(sizes)[:-1])
    labels = np.concatenate([item.labels[mask] for item, mask in zip(maps, masks, strict=True)])
    every = np.concatenate(fold_of)
    found = False
    for fold in np.unique(every):
        if len(np.unique(labels[every != fold])) < n_labels:
            continue
        found = True
        yield (
            _parts(maps, [numbers != fold for numbers in fold_of]),
            _parts(maps, [numbers == fold for numbers in fold_of]),
        )
    if not found:
        raise LabelError(
            "no fold can be held out: each one leaves some label without examples; label more, or "
            "use more folds"
        )


def _parts(maps: Sequence[LabelledMap], chosen: Sequence[NDArray[np.bool_]]) -> list[LabelledMap]:
    """The maps with their windows reduced to the chosen labelled cells."""
    found = []
    for item, kept in zip(maps, chosen, strict=True):
        if kept.any():
            window = np.zeros(item.grid.shape, np.bool_)
            window[item.labelled_cells] = kept
            found.append(replace(item, window=window))
    return found


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
    found = []
    for values in product(*settings.options.values()):
        options = dict(zip(settings.options, values, strict=True))
        found.append((options, changed_config(config, options)))
    return found


def _scored(
    experiment: Experiment,
    config: ExperimentConfig,
    method: str,
    learn: list[LabelledMap],
    test: list[LabelledMap],
) -> Evaluation:
    """A method trained on some maps and scored on others."""
    kept = replace(config, select=None, methods=tuple(m for m in config.methods if m.id == method))
    labeler = make_labeler(kept).fit(learn, n_threads=experiment.n_threads)
    scored = []
    for item in test:
        graph, scores = labeler.scores(item.grid, mask=item.cells, n_threads=experiment.n_threads)
        found = labeler.infer(graph, scores, method=method)
        scored.append(evaluate(item.truth(graph), found.labels, labeler.label_names_))
    return Evaluation.merged(scored)
