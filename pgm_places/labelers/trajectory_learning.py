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
from pgm_places.trajectories.segments import PathSegments
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary import list_learning, scan_model
from pgm_places.unary.scan_model import ScanModel
from pgm_places.unary.training_cells import training_features

KnownMaps = OccupancyGrid | Sequence[OccupancyGrid | None] | None
"""The map of all trajectories, or one for each."""


@dataclass(frozen=True, eq=False)
class ListExamples:
    """Training examples of the list: cells of each map, then labelled steps of each trajectory.

    Folds are buildings if there are several, else contiguous parts. ``steps`` (n,) are the indices
    of the labelled steps of each trajectory.
    """

    rows: list_learning.Rows
    n_of_map: tuple[int, ...]
    steps: tuple[NDArray[np.int64], ...]

    def split(
        self, values: NDArray[np.float64]
    ) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
        """Split values of all examples into arrays of each map and of each trajectory."""
        ends = np.cumsum([*self.n_of_map, *map(len, self.steps)])
        arrays = np.split(values, ends[:-1])
        return arrays[: len(self.n_of_map)], arrays[len(self.n_of_map) :]


def trajectory_examples(
    labeler: Any,
    maps: Sequence[LabelledMap],
    trajectories: Sequence[Trajectory],
    extra: Sequence[ArrayLike] | None = None,
    known_map: KnownMaps = None,
) -> ListExamples:
    """The features of labelled cells and steps, for the options of a TrajectoryLabeler.

    InputError if there is nothing to train on, a trajectory has no labels or other label names, or
    extra columns are given together with maps, whose cells have none. LabelError if a label has no
    example.
    """
    names, extra_names = tuple(labeler.label_names), tuple(labeler.extra_names)
    sensor, n_folds, features = labeler.sensor, labeler.n_folds, as_features(labeler.features)
    _require_sources(maps, trajectories, extra, extra_names, names)
    scan_model.check_scan_features(features)
    if maps and labeler.beams.spaces_m > 0:
        raise InputError(
            "spaces_m: space features along a path do not exist for cells of maps; train on drives "
            "only, such as simulated ones through these maps"
        )
    masks = [drive.labelled_cells for drive in maps]
    truths = [drive.labels[mask].astype(np.int64) for drive, mask in zip(maps, masks, strict=True)]
    tables = [training_features(maps, sensor, features)] if maps else []
    buildings = [*map_buildings(maps), *(drive.building for drive in trajectories)]
    folds = fold_of_buildings(buildings, n_folds)
    places = map(np.argwhere, masks)
    groups = [groups_of(*both, n_folds) for both in zip(folds, places, strict=False)]
    steps = []
    with report_stage("scans of trajectories") as stage:
        for number, drive in enumerate(trajectories):
            labels = _labels(drive)
            known = np.flatnonzero(labels >= 0)
            around = known_map[number] if isinstance(known_map, Sequence) else known_map
            views = scan_model.observed_along(drive, sensor, labeler.beams, known_map=around)
            columns = scan_model.check_extra(
                None if extra is None else extra[number], len(drive), extra_names
            )
            values = feature_values(
                views.circles_m[known], features, max_range_m=sensor.max_range_m
            )
            tables.append(np.concatenate([values, views.spaces[known], columns[known]], axis=1))
            truths.append(labels[known])
            order = np.arange(len(known))[:, None]
            groups.append(groups_of(folds[len(maps) + number], order, n_folds))
            steps.append(known)
            stage.update((number + 1) / len(trajectories))
    truth = np.concatenate(truths)
    _require_examples(truth, names)
    return ListExamples(
        list_learning.Rows(np.concatenate(tables), truth, np.concatenate(groups).astype(np.int64)),
        tuple(int(mask.sum()) for mask in masks),
        tuple(steps),
    )


def learn_list(labeler: Any, examples: ListExamples) -> tuple[ScanModel, NDArray[np.float64]]:
    """The list fitted on all examples, and (N, K) held-out scores."""
    from pgm_places.models.decision_list import DecisionListClassifier

    # Unlike on maps, scores are without the prior, which is part of the method.
    unfitted = labeler.classifier or DecisionListClassifier(order=list_learning.RAREST_FIRST)
    rows, n_labels = examples.rows, len(labeler.label_names)
    assert rows.groups is not None
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
    examples: ListExamples,
    scores: NDArray[np.float64],
) -> tuple[Any, ChosenDistance | None]:
    """The method fitted on segments of trajectories, or on maps without trajectories.

    ``scores`` (N, K) are held-out scores of the examples. The second result is the distance between
    updates, if it was chosen.
    """
    if not isinstance(method, Learnable):
        return with_shares(method, [examples.rows.truth], len(labeler.label_names)), None
    n_labels, moves_on_maps = len(labeler.label_names), False
    of_cells, of_steps = examples.split(scores)
    drives = [
        ObservedDrive(labelled.poses, log_z, _labels(labelled))
        for labelled, log_z in zip(
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

    def learn(every_m: float, selected: Sequence[ObservedDrive]) -> Any:
        problems, truths = [], []
        for drive in selected:
            segments = PathSegments(drive.poses, every_m)
            problems.append(segment_problem(labeler, method, segments, drive.scores))
            truths.append(segments.majority(drive.labels, n_labels))
        if not moves_on_maps:
            return method.fit(problems, truths)
        unaries = [problem.unary for problem in problems if problem.unary is not None]
        counted = method.with_counts(confusions=confusion_counts(truths, unaries, n_labels))
        return counted.with_sequences(problems, truths)

    def label(
        fitted: Any, segments: PathSegments, scores: NDArray[np.float64]
    ) -> NDArray[np.int64]:
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
    labeler: Any, method: Any, segments: PathSegments, scores: NDArray[np.float64]
) -> LabelingProblem:
    """The problem of a trajectory's segments with the mean scores (T, K) of their steps.

    The graph is a chain; for ``loop_m`` > 0 and methods for other graphs, it has links between
    passes of one spot. Steps with NaN scores (no observation) are ignored.
    """
    loop_m = 0.0 if traits_of(method).chains_only else labeler.loop_m
    names = tuple(labeler.label_names)
    logs, unseen = with_unseen_rows("scores", scores, len(segments.of_step), len(names))
    means = segments.means(np.exp(logs))
    if unseen is not None:
        means = segments.means(np.where(unseen[:, None], 0.0, np.exp(logs)))
        share = segments.means(~unseen[:, None])
        means = np.divide(means, share, out=np.full_like(means, np.nan), where=share > 0)
    with np.errstate(divide="ignore"):
        return LabelingProblem(segments.graph(loop_m=loop_m), names, unary=np.log(means))


def check_can_learn(method: object, trajectories: Sequence[Trajectory]) -> None:
    """Raise InputError for a trained method that needs trajectories, if there are none."""
    if trajectories or isinstance(method, HiddenMarkovModel) or not isinstance(method, Learnable):
        return
    raise InputError(
        f"{type(method).__name__} is trained on labelled trajectories; pass some, or use the "
        "method 'hmm', for which maps suffice"
    )


def _labels(trajectory: Trajectory) -> NDArray[np.int64]:
    assert trajectory.labels is not None  # checked by _require_sources
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
        raise InputError("extra columns and extra_names must be given together")
    if extra is not None and maps:
        raise InputError("cells of maps have no extra columns; train on labelled trajectories only")
    if extra is not None and len(extra) != len(trajectories):
        raise InputError(
            f"there are {len(trajectories)} trajectories but {len(extra)} tables of extra columns"
        )
    for drive in trajectories:
        if drive.label_names != label_names:
            raise InputError(
                f"{drive.name} must have the labels {', '.join(label_names)}, got "
                f"{'none' if drive.label_names is None else ', '.join(drive.label_names)}"
            )


def _require_examples(truth: NDArray[np.int64], label_names: tuple[str, ...]) -> None:
    n_labels, highest = len(label_names), int(truth.max(initial=-1))
    if missing := [repr(name) for k, name in enumerate(label_names) if k not in truth]:
        raise LabelError(
            f"no labelled cell or step is {' or '.join(missing)}; label some, or remove the name"
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
    """A TrajectoryLabeler per method, the last one is ``labeler``; and held-out scores.

    The scores, (n, K) of the labelled steps of each trajectory, are for training further methods.
    """
    labeler.check_options()
    methods = {name: as_backend(method) for name, method in methods.items()}
    if maps or trajectories:
        for method in methods.values():
            check_can_learn(method, trajectories)
    examples = trajectory_examples(labeler, maps, trajectories, extra, known_map)
    model, scores = learn_list(labeler, examples)

    def learn(method: Any) -> dict[str, Any]:
        method = with_edge_kinds(method) if labeler.loop_m > 0 else method
        fitted, chosen = learn_method(labeler, method, maps, trajectories, examples, scores)
        names = tuple(labeler.label_names)
        of_list = {"scan_model_": model, "label_names_": names}
        return {**of_list, "method_": fitted, "chosen_distance_": chosen}

    return labeler.set_learned_with(methods, learn), examples.split(scores)[1]
