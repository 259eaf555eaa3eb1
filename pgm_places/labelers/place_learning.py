"""Training the methods of a PlaceLabeler on held-out scores of labelled cells."""

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.evaluation.folds import map_buildings
from pgm_places.features.custom import as_features
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import Learnable, traits_of
from pgm_places.inference.problem import LabelingProblem
from pgm_places.inference.temperature import calibrated
from pgm_places.labelers.labeler import as_fitted, train_once
from pgm_places.labelers.method import PlaceMethod, with_shares, with_unary
from pgm_places.labelers.place_problem import cells_problem, shown_names
from pgm_places.maps.labelled_map import LabelledMap, require_examples
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.progress import Stage, report_stage, warn
from pgm_places.sensing.simulated_moves import N_RUNS, STAY_M, simulate_moves
from pgm_places.unary.feature_table import FeatureTables
from pgm_places.unary.floor_model import columns_of
from pgm_places.unary.halls import HallNames
from pgm_places.unary.learning import Halls, LearnedUnary, UnaryLearner
from pgm_places.unary.map_model import CellScores, sees_spaces
from pgm_places.unary.options import MIXED, ClassifierOptions


def confusion_counts(
    truths: Sequence[NDArray[np.int64]], scores: Sequence[NDArray[np.float64]], n_labels: int
) -> NDArray[np.int64]:
    """(K, K) confusion counts of the best labels of scores (N, K); rows are true labels.

    True labels (N,) are -1 where unknown.

    Examples
    --------
    >>> confusion_counts([np.array([0, 1, -1])], [np.log([[0.9, 0.1]] * 3)], 2).tolist()
    [[1, 0], [1, 0]]
    """
    counts = np.zeros((n_labels, n_labels), np.int64)
    for truth, log_z in zip(truths, scores, strict=True):
        known = np.flatnonzero(truth >= 0)
        np.add.at(counts, (truth[known], log_z[known].argmax(axis=1)), 1)
    return counts


def learn_movement(
    maps: Sequence[LabelledMap],
    truths: Sequence[NDArray[np.int64]],
    scores: Sequence[NDArray[np.float64]],
    n_labels: int,
    *,
    model: HiddenMarkovModel | None = None,
    n_runs: int = N_RUNS,
    seed: int = 0,
) -> HiddenMarkovModel:
    """A hidden Markov model with transitions from simulated moves and counted confusions.

    ``truths`` (N,) and ``scores`` (N, K) are per map, preferably held-out ones. The options are
    those of ``model``, by default with soft observations.
    """
    return (model or HiddenMarkovModel(observation="soft")).with_counts(
        confusions=confusion_counts(truths, scores, n_labels),
        moves=simulate_moves(maps, n_labels, n_runs=n_runs, seed=seed),
        stays=simulate_moves(maps, n_labels, n_runs=n_runs, seed=seed, step_m=STAY_M),
    )


@dataclass(frozen=True, eq=False)
class LabelledNodes:
    """The labelled cells of maps as nodes of a graph per map, with labels (N,) and held-out scores.

    ``scores`` is None for methods that are trained on labels only.
    """

    label_names: tuple[str, ...]
    graphs: tuple[LabelGraph, ...]
    truths: tuple[NDArray[np.int64], ...]
    scores: list[CellScores] | None

    @classmethod
    def of_maps(
        cls,
        maps: Sequence[LabelledMap],
        connectivity: int,
        label_names: tuple[str, ...],
        scores: list[CellScores] | None,
    ) -> Self:
        """The labelled cells of maps, with scores in the order of the nodes."""
        graphs = tuple(map_.graph(connectivity=connectivity, labelled_only=True) for map_ in maps)
        truths = tuple(map_.truth(graph) for map_, graph in zip(maps, graphs, strict=True))
        return cls(label_names, graphs, truths, scores)

    def problems(self, unary: str) -> list[LabelingProblem]:
        """A problem per map with a unary; without scores, all labels are equally likely."""
        if self.scores is None:
            shapes = [(graph.n_nodes, len(self.label_names)) for graph in self.graphs]
            return [
                LabelingProblem(graph, self.label_names, np.broadcast_to(0.0, shape))
                for graph, shape in zip(self.graphs, shapes, strict=True)
            ]
        return [
            cells_problem(graph, self.label_names, scores, unary)
            for graph, scores in zip(self.graphs, self.scores, strict=True)
        ]


def learn_places(
    labeler: Any, maps: list[LabelledMap], with_scores: bool, feature_cache: FeatureTables | None
) -> tuple[LearnedUnary, dict[str, Any]]:
    """Train a PlaceLabeler: the unary model and the fitted attributes."""
    names, space = tuple(labeler.label_names), labeler.space
    require_examples(maps, names)
    maps, names, halls = without_halls(maps, names)
    resolution_m = common_resolution(maps)
    methods = labeler.resolved_methods()
    unaries = {method.unary for method in methods.values()}
    wanted = unaries - {"auto"}
    candidates = unary_candidates(labeler, maps, halls) if "auto" in unaries else ()
    if candidates == ("laser",):  # nothing to choose, so no folds are needed
        methods, candidates = with_unary(methods, "laser"), ()
    trained = wanted.union(candidates)
    floor = labeler.floor if "floor" in trained else None
    unary = UnaryLearner(
        labeler.sensor,
        labeler.classifier or ClassifierOptions().classifier(names),
        len(names),
        n_node_features=labeler.n_node_features,
        max_examples_per_map=labeler.max_examples_per_map,
        context_m=tuple(labeler.context_m) if "context" in trained else (),
        space=space if sees_spaces(trained) else None,
        floor=None if floor is None else replace(floor, columns=columns_of(names)),
        doorway=None if space is None else space.doorway(names),
        halls=halls,
        candidates=candidates,
        wanted=wanted,
        learn_on=labeler.learn_on,
        n_folds=labeler.n_folds,
        features=as_features(labeler.features),
        with_scores=with_scores or learn_from_scores(methods),
        feature_cache=feature_cache,
    ).fit(maps)
    if unary.choice is not None:
        methods = with_unary(methods, unary.choice.unary)
    nodes = LabelledNodes.of_maps(maps, labeler.connectivity, names, unary.scores)
    held_out = unary.scores is not None and labeler.learn_on == "out-of-fold"
    fitted, seconds = learn_methods(methods, nodes, held_out)
    return unary, {
        "unary_model_": unary.model,
        "methods_": fitted,
        "learn_seconds_": seconds,
        "resolution_m_": resolution_m,
        "movement_": movement_of(maps, unary, len(names)),
        "label_names_": shown_names(names, unary.model, labeler.halls),
        "unary_choice_": unary.choice,
    }


def unary_candidates(
    labeler: Any, maps: Sequence[LabelledMap], halls: Halls | None
) -> tuple[str, ...]:
    """The unaries that a labeler can choose from; the first one is the default in a tie.

    The default is ``laser+space``. In unseen buildings it is rarely below ``laser``, whereas
    ``space`` and ``context`` often are after training on one or two buildings (docs/results.md).
    Fewer than three buildings do not show how these generalise: blocks of a building share its
    spaces, and a list trained on one building differs from one trained on two. If only a window of
    a single building is labelled, the rest of the building has the same spaces: ``space``.
    """
    others = ("context",) if labeler.context_m else ()
    with_networks = () if labeler.floor is None else ("floor",)
    if labeler.space is None:
        return ("laser", *others)
    n_buildings = len({*map_buildings(maps)})
    if n_buildings == 1 and any((map_.cells != map_.grid.free).any() for map_ in maps):
        return ("space", *with_networks)
    with_spaces = (MIXED, "space") if n_buildings > 2 else (MIXED,)
    # Only space features distinguish halls from corridors.
    on_scans = ("laser",) if halls is None else ()
    with_context = others if halls is None and n_buildings > 2 else ()
    return (*with_spaces, *on_scans, *with_context, *with_networks)


def movement_of(
    maps: Sequence[LabelledMap], unary: LearnedUnary, n_labels: int
) -> "HiddenMarkovModel | None":
    """The transitions of a simulated robot, or None if the labelled cells are too sparse."""
    try:
        return learn_movement(maps, unary.truths, unary.laser, n_labels)
    except InputError as error:
        warn(f"this model will not label trajectories: {error}")
        return None


def learn_from_scores(methods: Mapping[str, PlaceMethod]) -> bool:
    """Whether any method is trained on scores of cells, not only on their labels."""
    learners = [
        method.backend for method in methods.values() if isinstance(method.backend, Learnable)
    ]
    return not all(traits_of(backend).learns_from_labels for backend in learners)


def learn_methods(
    methods: Mapping[str, PlaceMethod], nodes: LabelledNodes, held_out: bool
) -> tuple[dict[str, PlaceMethod], dict[str, float]]:
    """The fitted methods, and the training time of each (s).

    Methods without training get the labels' shares. Methods with the same training are fitted once,
    and the time counts for the first of them. Held-out scores are used to calibrate beliefs.
    """

    def train(name: str) -> Any:
        backend = methods[name].backend
        if not isinstance(backend, Learnable):
            return with_shares(backend, nodes.truths, len(nodes.label_names))
        with report_stage(f"training {name}") as stage:
            return _fitted(backend, nodes.problems(methods[name].unary), nodes.truths, stage)

    def adapt(name: str, backend: Any) -> Any:
        return as_fitted(methods[name].backend, backend)

    pairs = {name: (method.backend, method.unary) for name, method in methods.items()}
    trained = train_once(pairs, train, adapt)
    fitted = {name: replace(methods[name], backend=each) for name, (each, _) in trained.items()}
    seconds = {
        name: spent
        for name, (_, spent) in trained.items()
        if spent and isinstance(methods[name].backend, Learnable)
    }
    for name, method in fitted.items() if held_out else ():
        backend = calibrated(method.backend, nodes.problems(method.unary), nodes.truths)
        fitted[name] = replace(method, backend=backend)
    return fitted, seconds


def without_halls(
    maps: Sequence[LabelledMap], names: tuple[str, ...]
) -> tuple[list[LabelledMap], tuple[str, ...], Halls | None]:
    """The maps with halls as corridors, the remaining labels, and the cells of halls."""
    hall_names = HallNames.among(names)
    if hall_names is None:
        return list(maps), names, None
    are_halls = np.concatenate([hall_names.are_halls(map_) for map_ in maps])
    left = hall_names.folded
    return [hall_names.fold(map_) for map_ in maps], left, Halls(left.index("corridor"), are_halls)


def common_resolution(maps: Sequence[LabelledMap]) -> float:
    """The resolution of all maps (m); InputError if they differ by more than a thousandth."""
    sizes: NDArray[np.float64] = np.array([map_.grid.resolution_m for map_ in maps])
    if not np.allclose(sizes, sizes[0], rtol=1e-3, atol=0.0):
        listed = ", ".join(f"{map_.name} {map_.grid.resolution_m:g} m" for map_ in maps)
        raise InputError(
            f"training maps must have one resolution, got {listed}; "
            "set resolution_m to coarsen them"
        )
    return float(sizes[0])


def _fitted(
    backend: Any,
    problems: Sequence[LabelingProblem],
    truths: Sequence[NDArray[np.int64]],
    stage: Stage,
) -> Any:
    """The fitted backend; its iterations are reported to the stage."""
    if "on_iteration" not in inspect.signature(backend.fit).parameters:
        return backend.fit(problems, truths)

    def show(step: Any) -> None:
        gap = max(float(step.gap), 1e-6)
        # The gap shrinks about geometrically: show its logarithm, down to 0.1 %.
        fraction = min(max(-math.log10(gap) / 3, 0.0), 1.0)
        stage.update(fraction, f"gap {100 * gap:.2g} %, {step.n_cuts} cuts")

    return backend.fit(problems, truths, on_iteration=show)
