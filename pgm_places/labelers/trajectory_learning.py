"""Training a TrajectoryLabeler: the list on cells and steps, the method on held-out scores."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError, LabelError
from pgm_places.evaluation.bootstrap import is_ahead
from pgm_places.evaluation.evaluation import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.evaluation.folds import fold_of_buildings, groups_of, map_buildings
from pgm_places.features.custom import as_features, feature_values
from pgm_places.inference.backends import Learnable, traits_of
from pgm_places.inference.potentials import with_unseen_rows
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.method import as_backend, with_edge_kinds, with_shares
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.progress import report_stage
from pgm_places.trajectories.path import PathSegments
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary import list_learning, scan_model
from pgm_places.unary.scan_model import ScanModel
from pgm_places.unary.training_cells import training_features

EVERY_M = 0.1
"""Default distance between updates. The paper has 0.2 to 0.5 m; shorter ones find more doorways."""

TRIED_M = (0.1, 0.2, 0.35)
"""Candidate distances. The first is used unless another is significantly better."""

STRETCH_M = 5.0
"""Length of the stretches of a drive whose errors count as dependent."""

WHOLE_DRIVES, FOLDS = 3, 5
"""Least number of drives to hold out complete drives, and largest number of folds."""


class ObservedDrive(NamedTuple):
    """The poses (T, 3), held-out scores (T, K) and labels (T,) of the labelled steps of a drive."""

    poses: NDArray[np.float64]
    scores: NDArray[np.float64]
    labels: NDArray[np.int64]

    def part(self, steps: slice) -> "ObservedDrive":
        """A part of the steps."""
        return ObservedDrive(self.poses[steps], self.scores[steps], self.labels[steps])


Learn = Callable[[float, Sequence[ObservedDrive]], Any]
"""The method fitted on drives, with updates at a fixed distance in metres."""

LabelDrive = Callable[[Any, PathSegments, NDArray[np.float64]], NDArray[np.int64]]
"""The label of each segment by a fitted method, from the scores of the steps."""


class ChosenDistance(NamedTuple):
    """The distance with the best labels of held-out steps, and a text with all results."""

    every_m: float
    words: str


class WithDistance:
    """Mixin for labelers with a fixed or chosen distance between updates."""

    every_m: Any
    chosen_distance_: ChosenDistance | None = None

    @property
    def update_m(self) -> float:
        """Distance between updates (m): the option, or the chosen distance."""
        if self.every_m != "auto":
            return float(self.every_m)
        return self.chosen_distance_.every_m if self.chosen_distance_ else EVERY_M

    @property
    def method_choices(self) -> dict[str, str]:
        """Options of the labeler that were chosen for the method, with a text each."""
        chosen = self.chosen_distance_ if self.every_m == "auto" else None
        return {"every_m": chosen.words} if chosen else {}


def chosen_distance(
    drives: Sequence[ObservedDrive], learn: Learn, label: LabelDrive
) -> ChosenDistance:
    """The distance in :data:`TRIED_M` with the best labels of held-out drives, or thirds of drives.

    Distances significantly more accurate than the first
    (:func:`pgm_places.evaluation.bootstrap.is_ahead`) compete by the mean of accuracy and balanced
    accuracy.
    """
    folds = _folds(drives)
    truth = np.concatenate([drive.labels for held_out in folds for drive in held_out])
    stretch, right = _stretches([drive for held_out in folds for drive in held_out]), []
    results = []
    for every_m in TRIED_M:
        answers = []
        for number, held_out in enumerate(folds):
            others = [drive for k, fold in enumerate(folds) if k != number for drive in fold]
            fitted = learn(every_m, others)
            for drive in held_out:
                segments = PathSegments(drive.poses, every_m)
                answers.append(label(fitted, segments, drive.scores)[segments.of_step])
        labels = np.concatenate(answers)
        confusion = confusion_matrix(truth, labels)
        results.append((float(accuracy(confusion)), float(balanced_accuracy(confusion))))
        right.append((labels == truth).astype(np.float64))
    ahead = [k for k, drive in enumerate(right) if is_ahead(drive - right[0], stretch)]
    best = max(ahead, key=lambda k: round(sum(results[k]), 9), default=0)
    figures = ", ".join(
        f"{every_m:g} m {100 * accurate:.1f} / {100 * balanced:.1f}"
        for every_m, (accurate, balanced) in zip(TRIED_M, results, strict=True)
    )
    words = f"{TRIED_M[best]:g} (accuracy / balanced accuracy on held-out steps: {figures})"
    return ChosenDistance(TRIED_M[best], words)


def _folds(drives: Sequence[ObservedDrive]) -> list[list[ObservedDrive]]:
    """The drives, or parts of drives, of each fold."""
    if len(drives) >= WHOLE_DRIVES:
        return [list(drives[k::FOLDS]) for k in range(min(FOLDS, len(drives)))]
    folds: list[list[ObservedDrive]] = [[] for _ in range(WHOLE_DRIVES)]
    for drive in drives:
        cuts = np.linspace(0, len(drive.labels), WHOLE_DRIVES + 1).astype(int).tolist()
        for fold, first, last in zip(folds, cuts[:-1], cuts[1:], strict=True):
            if last > first:
                fold.append(drive.part(slice(first, last)))
    return [fold for fold in folds if fold]


def _stretches(drives: Sequence[ObservedDrive]) -> NDArray[np.int64]:
    """(N,) the index of the stretch of each step, over all drives."""
    numbers, first = [], 0
    for drive in drives:
        own = PathSegments(drive.poses, STRETCH_M).of_step
        numbers.append(first + own)
        first += int(own.max(initial=-1)) + 1
    return np.concatenate(numbers)


KnownMaps = OccupancyGrid | Sequence[OccupancyGrid | None] | None
"""The map of all trajectories, or one for each."""


@dataclass(frozen=True, eq=False)
class ListExamples:
    """Cells of maps, then labelled ``steps`` of trajectories; folds are buildings, if several."""

    rows: list_learning.Rows
    n_of_map: tuple[int, ...]
    steps: tuple[NDArray[np.int64], ...]

    def split(self, values: NDArray[Any]) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
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

    InputError without training data, for a trajectory without labels or with other names, or for
    extra columns with maps, which lack them; LabelError for a label without example.
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
    """The method fitted on segments of trajectories, or of maps, and a chosen distance of updates.

    ``scores`` (N, K) are held-out scores of the examples.
    """
    from pgm_places.labelers.place_learning import (  # not needed for labelling
        confusion_counts,
        learn_movement,
    )

    if not isinstance(method, Learnable):
        return with_shares(method, [examples.rows.truth], len(labeler.label_names)), None
    n_labels, moves_on_maps = len(labeler.label_names), False
    of_cells, of_steps = examples.split(scores)
    drives = [
        ObservedDrive(drive.poses[steps], log_z, _labels(drive)[steps])
        for drive, steps, log_z in zip(trajectories, examples.steps, of_steps, strict=True)
    ]
    if isinstance(method, HiddenMarkovModel) and maps:
        moves_on_maps = True
        known, _ = examples.split(examples.rows.truth)
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

    if labeler.every_m != "auto" or not isinstance(method, HiddenMarkovModel):
        return learn(EVERY_M if labeler.every_m == "auto" else labeler.every_m, drives), None
    chosen = chosen_distance(drives, learn, label)
    return learn(chosen.every_m, drives), chosen


def segment_problem(
    labeler: Any, method: Any, segments: PathSegments, scores: NDArray[np.float64]
) -> LabelingProblem:
    """The problem of a trajectory's segments, a chain, with the mean scores (T, K) of their steps.

    ``loop_m`` > 0 links passes of one spot, if the method can. Steps with NaN scores are ignored.
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

    The scores, (n, K) per trajectory, are for training further methods.
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
