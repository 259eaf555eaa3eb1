"""Training a TrajectoryLabeler: the list on cells and steps, the method on held-out scores."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError, LabelError
from pgm_places.evaluation.folds import fold_of_buildings, groups_of, map_buildings
from pgm_places.features.custom import as_features, feature_values
from pgm_places.inference.backends import Learnable, traits_of
from pgm_places.inference.potentials import with_unseen_rows
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.method import as_backend, with_edge_kinds, with_shares
from pgm_places.labelers.place_learning import confusion_counts, learn_movement
from pgm_places.labelers.update_distance import (
    EVERY_M,
    ChosenDistance,
    ObservedDrive,
    chosen_distance,
)
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.progress import report_stage
from pgm_places.trajectories.segments import Segments
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary import list_learning, scan_model
from pgm_places.unary.scan_model import ScanModel
from pgm_places.unary.training_cells import training_features

KnownMaps = OccupancyGrid | Sequence[OccupancyGrid | None] | None
"""The map of all trajectories, or one for each."""


@dataclass(frozen=True, eq=False)
class Examples:
    """What the list learns from: cells of maps, then the labelled steps of trajectories.

    Parameters
    ----------
    rows : Rows
        Of the list, held out by whole buildings where there are several, else contiguous parts.
    n_of_map : tuple of int
        Cells of each map.
    steps : tuple of (n,) int
        Numbers of the labelled steps of each trajectory.
    """

    rows: list_learning.Rows
    n_of_map: tuple[int, ...]
    steps: tuple[NDArray[np.int64], ...]

    def split(
        self, values: NDArray[np.float64]
    ) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
        """Values of all examples as those of each map's and of each trajectory's."""
        ends = np.cumsum([*self.n_of_map, *(len(part) for part in self.steps)])
        parts = np.split(values, ends[:-1])
        return parts[: len(self.n_of_map)], parts[len(self.n_of_map) :]


def trajectory_examples(
    labeler: Any,
    maps: Sequence[LabelledMap],
    trajectories: Sequence[Trajectory],
    extra: Sequence[ArrayLike] | None = None,
    known_map: KnownMaps = None,
) -> Examples:
    """All features of labelled cells and steps, and the extra columns of the steps.

    What they are is said by the options of a TrajectoryLabeler, which imports this module.

    Raises
    ------
    InputError
        There is nothing to train on, a trajectory has no labels or those of other names, or
        extra columns are given together with maps, whose cells have none.
    LabelError
        A label has no example.
    """
    names, extra_names = tuple(labeler.label_names), tuple(labeler.extra_names)
    sensor, n_folds, features = labeler.sensor, labeler.n_folds, as_features(labeler.features)
    _require_sources(maps, trajectories, extra, extra_names, names)
    scan_model.check_scan_features(features)
    if maps and labeler.beams.spaces_m > 0:
        raise InputError(
            "spaces_m: the spaces that a robot sees along its path are unknown for cells of "
            "maps; train on drives alone, such as simulated ones through these maps"
        )
    masks = [item.labelled_cells for item in maps]
    truths = [item.labels[mask].astype(np.int64) for item, mask in zip(maps, masks, strict=True)]
    parts = [training_features(maps, sensor, features)] if maps else []
    buildings = [*map_buildings(maps), *(item.building for item in trajectories)]
    folds = fold_of_buildings(buildings, n_folds)
    places = map(np.argwhere, masks)
    groups = [groups_of(*both, n_folds) for both in zip(folds, places, strict=False)]
    steps = []
    with report_stage("scans of trajectories") as stage:
        for number, item in enumerate(trajectories):
            labels = _labels(item)
            known = np.flatnonzero(labels >= 0)
            around = known_map[number] if isinstance(known_map, Sequence) else known_map
            seen = scan_model.observed_along(item, sensor, labeler.beams, known_map=around)
            columns = scan_model.check_extra(
                None if extra is None else extra[number], len(item), extra_names
            )
            values = feature_values(seen.circles_m[known], features, max_range_m=sensor.max_range_m)
            parts.append(np.concatenate([values, seen.spaces[known], columns[known]], axis=1))
            truths.append(labels[known])
            order = np.arange(len(known))[:, None]
            groups.append(groups_of(folds[len(maps) + number], order, n_folds))
            steps.append(known)
            stage.update((number + 1) / len(trajectories))
    truth = np.concatenate(truths)
    _require_examples(truth, names)
    return Examples(
        list_learning.Rows(np.concatenate(parts), truth, np.concatenate(groups).astype(np.int64)),
        tuple(int(mask.sum()) for mask in masks),
        tuple(steps),
    )


def learn_list(labeler: Any, examples: Examples) -> tuple[ScanModel, NDArray[np.float64]]:
    """The list fitted on all examples, and (N, K) what lists say of examples held out."""
    from pgm_places.models.decision_list import DecisionListClassifier

    # Without the prior in z, unlike on maps: the method knows how frequent labels are.
    unfitted = labeler.classifier or DecisionListClassifier(order=list_learning.RAREST_FIRST)
    rows, n_labels = examples.rows, len(labeler.label_names)
    assert rows.groups is not None  # of all examples
    unfitted = list_learning.with_explicit_order(unfitted, rows.truth)
    fitted, lists = list_learning.cross_fitted(unfitted, rows, "decision list")
    scores = list_learning.scores_of(lists, rows.features, rows.groups, n_labels)
    own, further = as_features(labeler.features), tuple(labeler.extra_names)
    sees_spaces = labeler.beams.spaces_m > 0
    return ScanModel(fitted, n_labels, labeler.sensor, further, own, sees_spaces), scores


def learn_method(
    labeler: Any,
    method: Any,
    maps: Sequence[LabelledMap],
    trajectories: Sequence[Trajectory],
    examples: Examples,
    scores: NDArray[np.float64],
) -> tuple[Any, ChosenDistance | None]:
    """The method fitted on observations as it will see them: on segments where there are any.

    ``scores`` (N, K) are what lists say of the examples that they have not seen. The second result
    is the distance between updates where it was chosen.
    """
    if not isinstance(method, Learnable):
        return with_shares(method, [examples.rows.truth], len(labeler.label_names)), None
    n_labels, moves_on_maps = len(labeler.label_names), False
    of_cells, of_steps = examples.split(scores)
    drives = [
        ObservedDrive(labelled.poses, part, _labels(labelled))
        for labelled, part in zip(
            map(Trajectory.subset, trajectories, examples.steps), of_steps, strict=True
        )
    ]
    if isinstance(method, HiddenMarkovModel) and maps:
        moves_on_maps = True
        known = np.split(examples.rows.truth, np.cumsum(examples.n_of_map))[:-1]
        drawn = {"n_runs": labeler.n_runs, "seed": labeler.seed}
        method = learn_movement(maps, known, of_cells, n_labels, model=method, **drawn)
        if not drives:
            return method, None

    def learn(every_m: float, some: Sequence[ObservedDrive]) -> Any:
        problems, truths = [], []
        for item in some:
            segments = Segments(item.poses, every_m)
            problems.append(segment_problem(labeler, method, segments, item.scores))
            truths.append(segments.majority(item.labels, n_labels))
        if not moves_on_maps:
            return method.fit(problems, truths)
        said = [problem.unary for problem in problems if problem.unary is not None]
        counted = method.with_counts(confusions=confusion_counts(truths, said, n_labels))
        return counted.with_sequences(problems, truths)

    def label(fitted: Any, segments: Segments, scores: NDArray[np.float64]) -> NDArray[np.int64]:
        labels: NDArray[np.int64] = fitted.infer(
            segment_problem(labeler, fitted, segments, scores)
        ).labels
        return labels

    if labeler.every_m != "auto":
        return learn(labeler.every_m, drives), None
    if not isinstance(method, HiddenMarkovModel):
        return learn(EVERY_M, drives), None
    chosen = chosen_distance(drives, learn, label)
    return learn(chosen.every_m, drives), chosen


def segment_problem(
    labeler: Any, method: Any, segments: Segments, scores: NDArray[np.float64]
) -> LabelingProblem:
    """The graph of a trajectory's segments with the mean scores (T, K) of their steps.

    Steps whose scores are NaN, of which nothing was observed, do not count.

    A chain and, for ``loop_m`` > 0 and methods that label more than chains, links between passes of
    one spot.
    """
    loop_m = 0.0 if traits_of(method).chains_only else labeler.loop_m
    names = tuple(labeler.label_names)
    logs, unseen = with_unseen_rows("scores", scores, len(segments.of_step), len(names))
    means = segments.means(np.exp(logs))
    if unseen is not None:
        means = segments.means(np.where(unseen[:, None], 0.0, np.exp(logs)))
        seen = segments.means(~unseen[:, None])
        means = np.divide(means, seen, out=np.full_like(means, np.nan), where=seen > 0)
    with np.errstate(divide="ignore"):
        return LabelingProblem(segments.graph(loop_m=loop_m), names, unary=np.log(means))


def check_can_learn(method: object, trajectories: Sequence[Trajectory]) -> None:
    """Refuse to learn from maps alone what needs a sequence, before anything is learned.

    Raises
    ------
    InputError
        The method learns, is no hidden Markov model, and there are no trajectories.
    """
    if trajectories or isinstance(method, HiddenMarkovModel) or not isinstance(method, Learnable):
        return
    raise InputError(
        f"{type(method).__name__} is trained on labelled trajectories; pass some, or use the "
        "method 'hmm', for which maps suffice"
    )


def _labels(trajectory: Trajectory) -> NDArray[np.int64]:
    assert trajectory.labels is not None  # _require_sources has checked
    return trajectory.labels


def _require_sources(
    maps: Sequence[LabelledMap],
    trajectories: Sequence[Trajectory],
    extra: Sequence[ArrayLike] | None,
    extra_names: tuple[str, ...],
    label_names: tuple[str, ...],
) -> None:
    if not maps and not trajectories:
        raise InputError("there is nothing to train on; pass labelled maps or trajectories")
    if (extra is None) != (not extra_names):
        raise InputError("extra columns and extra_names belong together: give both, or neither")
    if extra is not None and maps:
        raise InputError(
            "cells of maps have no extra columns; train on labelled trajectories alone"
        )
    if extra is not None and len(extra) != len(trajectories):
        raise InputError(
            f"there are {len(trajectories)} trajectories but {len(extra)} tables of extra columns"
        )
    for item in trajectories:
        if item.label_names != label_names:
            raise InputError(
                f"{item.name} must have the labels {', '.join(label_names)}, got "
                f"{'none' if item.label_names is None else ', '.join(item.label_names)}"
            )


def _require_examples(truth: NDArray[np.int64], label_names: tuple[str, ...]) -> None:
    n_labels, highest = len(label_names), int(truth.max(initial=-1))
    if missing := [repr(name) for k, name in enumerate(label_names) if k not in truth]:
        raise LabelError(
            f"no labelled cell or step is {' or '.join(missing)}; label some, or take the name out"
        )
    if highest >= n_labels:
        raise LabelError(f"label index {highest} but there are only {n_labels} labels")


def learn_labelers(
    labeler: Any,
    methods: Mapping[str, Any],
    maps: Sequence[LabelledMap],
    trajectories: Sequence[Trajectory],
    extra: Sequence[ArrayLike] | None,
    known_map: KnownMaps,
) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """A TrajectoryLabeler per method, the last of them the given one, and held-out scores.

    These are one (n, K) array per trajectory, of its steps whose place is known: what a further
    method is to learn from.
    """
    labeler.check_options()
    methods = {name: as_backend(method) for name, method in methods.items()}
    if maps or trajectories:
        for method in methods.values():
            check_can_learn(method, trajectories)
    examples = trajectory_examples(labeler, maps, trajectories, extra, known_map)
    model, scores = learn_list(labeler, examples)

    def learn(method: Any) -> dict[str, Any]:
        seen = with_edge_kinds(method) if labeler.loop_m > 0 else method
        fitted, chosen = learn_method(labeler, seen, maps, trajectories, examples, scores)
        names = tuple(labeler.label_names)
        of_list = {"scan_model_": model, "label_names_": names}
        return {**of_list, "method_": fitted, "chosen_distance_": chosen}

    return labeler.set_learned_with(methods, learn), examples.split(scores)[1]
