"""Training the unary model: boosted lists on the cells of labelled maps, and held-out scores."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.features.context import window_means
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.list_average import list_average
from pgm_places.progress import Progress, Silent
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.cell_lists import aligned_log_proba, without_halls
from pgm_places.unary.feature_tables import FeatureTables
from pgm_places.unary.floor_model import FloorModel, with_floor
from pgm_places.unary.map_model import CellScores, UnaryModel
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.space_learning import learn_spaces
from pgm_places.unary.temperatures import with_temperatures
from pgm_places.unary.training_cells import TrainingCells

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier

RAREST_FIRST = "rarest-first"
"""An order of the list that PlaceLabeler understands besides those of the list itself."""

__all__ = [
    "Halls",
    "LearnedUnary",
    "fit_unary",
    "fitted_list",
    "held_out_lists",
    "held_out_scores",
    "with_explicit_order",
    "without_a_domain",
]


@dataclass(frozen=True, eq=False)
class Halls:
    """Which circulation is a hall.

    Parameters
    ----------
    corridor : int
        The label that halls share with other circulation.
    are_halls : (N,) bool
        The labelled cells of all maps, map after map, that are halls.
    """

    corridor: int
    are_halls: NDArray[np.bool_]


Extra = Callable[[NDArray[np.int64]], NDArray[np.float32]]
"""Columns (n, D) beside the cells' own features, for cells by their numbers."""


@dataclass(frozen=True, eq=False)
class LearnedUnary:
    """A fitted unary model, and the scores that whatever comes behind it learns from.

    Parameters
    ----------
    model : UnaryModel
    truths : list of (n,) int64
        Label index of the examples of each map.
    laser : list of (n, K) float64
        What laser lists say of them.
    scores : list of CellScores or None
        One per map, in the node order of its graph of labelled cells; only where it was asked for.
    """

    model: UnaryModel
    truths: list[NDArray[np.int64]]
    laser: list[NDArray[np.float64]]
    scores: list[CellScores] | None


def fit_unary(
    maps: Sequence[LabelledMap],
    n_labels: int,
    *,
    sensor: Sensor,
    classifier: "DecisionListClassifier",
    n_node_features: int = 30,
    context_m: tuple[float, ...] = (),
    space: SpaceOptions | None = None,
    doorway: int | None = None,
    halls: Halls | None = None,
    floor: FloorModel | None = None,
    learn_on: str = "out-of-fold",
    n_folds: int = 5,
    max_examples_per_map: int | None = None,
    features: tuple[Any, ...] = (),
    with_scores: bool = True,
    feature_cache: FeatureTables | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> LearnedUnary:
    """A unary model fitted on the labelled cells of maps, and scores to learn from.

    Parameters
    ----------
    maps : sequence of LabelledMap
        Where to learn; only free, labelled cells inside the windows are used.
    n_labels : int
        K.
    sensor, classifier
        The sensor to simulate and an unfitted list with its options.
    n_node_features : int
        How many of the features that boosting chose first are handed to structured models.
    context_m : tuple of float
        Half-widths in metres of the windows for the list with context; () for none.
    space : SpaceOptions, optional
        The list that also sees segments, gates and places; none by default.
    doorway : int, optional
        The label of gates, where there is one.
    halls : Halls, optional
        Which labelled cells are halls, to tell them from other corridors.
    floor : FloorModel, optional
        Networks that see the whole floor, and have not seen these maps.
    learn_on : {"in-sample", "out-of-fold"}
        Whether the returned scores come from the fitted lists, or from lists that did not see the
        building that a cell lies in, or its contiguous block where there is only one building.
    n_folds : int
        Folds for out-of-fold scores: number of blocks, or maximum number of groups of buildings.
    max_examples_per_map : int, optional
        Train the lists on a random sample of this many cells of each map.
    features : tuple
        Custom features, in addition to the laser's: see :mod:`pgm_places.features.own`.
    with_scores : bool
        Whether all labelled cells are scored, to train structured methods on.
    feature_cache : FeatureTables, optional
        Where laser features of the maps are kept; not used with custom features, whose code may
        change.
    """
    progress = progress or Silent()
    cells = TrainingCells.of(
        maps,
        sensor,
        features,
        n_folds=n_folds,
        limit=max_examples_per_map,
        wants_all=with_scores or bool(context_m),
        feature_cache=feature_cache,
        n_threads=n_threads,
        progress=progress,
    )
    held_out = learn_on == "out-of-fold" or bool(context_m)
    learner = _Learner(cells, n_labels, learn_on, held_out, n_threads, progress)
    classifier = with_explicit_order(classifier, cells.truth)

    laser = learner.learn(
        "decision list", classifier, scored="all" if with_scores or context_m else "examples"
    )
    columns = np.asarray(laser.fitted.features_in_order_of_choice(n_node_features), np.int64)
    context = None
    if context_m:
        means = _context_means(cells, np.exp(laser.held_out), context_m)
        # Stumps: their votes on scans and on context can be cast apart, those of trees cannot.
        order = laser.fitted.classes[laser.fitted.order].tolist()
        stumps = _like(classifier, order=order, max_depth=1, shrinkage=1.0)
        context = learner.learn(
            "list with context", stumps, lambda some: means[some], "all" if with_scores else "none"
        )
    spaces, of_spaces = None, None
    if space is not None:
        found = learn_spaces(cells, doorway, n_threads, progress)
        if halls is not None:
            truth = np.where(halls.are_halls, n_labels, cells.truth)
            learner = replace(learner, cells=replace(cells, truth=truth), n_labels=n_labels + 1)
        spaces = learner.learn(
            "list with spaces",
            with_explicit_order(space.classifier(), learner.cells.truth),
            found.columns,
            "all" if with_scores else "none",
            space.max_examples_per_map,
            learner.cells.domain,
        )
        of_spaces = spaces.of_all
        if halls is not None:
            of_spaces, _ = without_halls(of_spaces, halls.corridor)
        of_spaces = found.scores(of_spaces) if with_scores else None
    model = UnaryModel(
        sensor,
        laser.fitted,
        n_labels,
        columns,
        context_m,
        None if context is None else context.fitted,
        features,
        None
        if spaces is None
        else found.model(spaces.fitted, None if halls is None else halls.corridor),
        floor,
    )
    starts = np.cumsum([0, *cells.sizes])
    mine = np.searchsorted(cells.examples, starts)
    return LearnedUnary(
        model,
        np.split(cells.truth[cells.examples], mine[1:-1]),
        np.split(laser.of_examples, mine[1:-1]),
        [
            _with_floor(CellScores(*parts), cells, m, floor, n_threads)
            for m, parts in enumerate(
                zip(
                    cells.by_map(laser.of_all),
                    _by_map(cells, None if context is None else context.of_all),
                    _by_map(cells, of_spaces),
                    cells.by_map(learner.node_features(columns)),
                    strict=True,
                )
            )
        ]
        if with_scores
        else None,
    )


def _with_floor(
    scores: CellScores,
    cells: TrainingCells,
    m: int,
    floor: FloorModel | None,
    n_threads: int | None,
) -> CellScores:
    """The scores of a map's labelled cells, and those with what the networks see of it."""
    if floor is None or scores.space is None:
        return scores
    seen = floor.scores(cells.maps[m].grid, n_threads)
    return replace(scores, floor=with_floor(scores.space, seen, floor, cells.layout(m)))


@dataclass(frozen=True, eq=False)
class _Learned:
    """A fitted list and what it, or lists of its kind that were held out, say of cells."""

    fitted: BoostedList
    held_out: NDArray[np.float64]
    of_all: NDArray[np.float64]
    of_examples: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Learner:
    """Lists of several kinds on the same cells."""

    cells: TrainingCells
    n_labels: int
    learn_on: str
    held_out: bool
    n_threads: int | None
    progress: Progress

    def learn(
        self,
        name: str,
        unfitted: "DecisionListClassifier",
        extra: Extra | None = None,
        scored: Literal["all", "examples", "none"] = "all",
        limit: int | None = None,
        domain: NDArray[np.int64] | None = None,
    ) -> _Learned:
        """A list fitted on the examples, and the scores of all cells, of the examples, or none.

        With ``limit`` it is fitted on at most that many examples of each map; with the ``domain``
        (N,) of all cells it is the mean of lists that were fitted without one.
        """
        cells, examples = self.cells, self.cells.examples
        some = slice(None) if limit is None else cells.some_examples(limit)
        values = _beside(cells.features[some], examples[some], extra)
        truth, groups = cells.truth[examples[some]], cells.groups[examples[some]]
        domain = None if domain is None else domain[examples[some]]
        tempered = unfitted.calibration == "temperature"
        if tempered:
            unfitted = _like(unfitted, calibration="none")
        with self.progress.stage(name):
            fitted = fitted_list(unfitted, values, truth, groups, domain)
        lists = {}
        if tempered or (self.held_out and scored != "none"):
            stage = f"held-out scores: {name}"
            ordered = _in_the_order_of(fitted, unfitted)
            lists = held_out_lists(ordered, values, truth, groups, self.progress, stage, domain)
        if tempered:
            fitted, lists = with_temperatures(fitted, lists, values, truth, groups)
        empty = np.empty((0, self.n_labels))
        if scored == "none":
            return _Learned(fitted, empty, empty, empty)
        everyone = dict.fromkeys(np.unique(cells.groups).tolist(), fitted)
        if not self.held_out:
            lists = everyone
        chosen = everyone if self.learn_on == "in-sample" else lists
        if scored == "examples":
            part = _scores_of(chosen, values, groups, self.n_labels, self.n_threads)
            return _Learned(fitted, part, empty, part)
        held_out = self._all_scores(lists, extra)
        of_all = held_out if chosen is lists else self._all_scores(chosen, extra)
        return _Learned(fitted, held_out, of_all, of_all[examples])

    def node_features(self, columns: NDArray[np.int64]) -> NDArray[np.float32]:
        """(N, D) some columns of all cells."""
        found = np.empty((len(self.cells.truth), len(columns)), np.float32)
        for some, values in self.cells.blocks(self.n_threads):
            found[some] = values[:, columns]
        return found

    def _all_scores(
        self, lists: dict[int, BoostedList], extra: Extra | None
    ) -> NDArray[np.float64]:
        found = np.empty((len(self.cells.truth), self.n_labels))
        for some, values in self.cells.blocks(self.n_threads):
            part = _beside(values, some, extra)
            groups = self.cells.groups[some]
            found[some] = _scores_of(lists, part, groups, self.n_labels, self.n_threads)
        return found


def _like(estimator: "DecisionListClassifier", **options: Any) -> "DecisionListClassifier":
    """The same estimator, not fitted, with some options changed."""
    from sklearn.base import clone

    found: DecisionListClassifier = clone(estimator).set_params(**options)
    return found


def _beside(
    values: NDArray[np.float32], cells: NDArray[np.int64], extra: Extra | None
) -> NDArray[np.float32]:
    return values if extra is None else np.concatenate([values, extra(cells)], axis=1)


def _by_map(cells: TrainingCells, values: NDArray[np.float64] | None) -> Sequence[Any]:
    return [None] * len(cells.maps) if values is None else cells.by_map(values)


def _scores_of(
    lists: dict[int, BoostedList],
    values: NDArray[np.float32],
    groups: NDArray[np.int64],
    n_labels: int,
    n_threads: int | None = None,
) -> NDArray[np.float64]:
    """(n, K) log z of rows, each from the list of its group."""
    folds = np.unique(groups).tolist()
    if len({id(lists[fold]) for fold in folds}) == 1:
        return aligned_log_proba(lists[folds[0]], values, n_labels, n_threads)
    found = np.empty((len(values), n_labels))
    for fold in folds:
        rows = groups == fold
        found[rows] = aligned_log_proba(lists[fold], values[rows], n_labels, n_threads)
    return found


def with_explicit_order(
    classifier: "DecisionListClassifier", truth: NDArray[np.int64]
) -> "DecisionListClassifier":
    """The list with ``"rarest-first"`` written out as the labels by increasing frequency.

    Asked first, a rare label is separated from everything by one classifier; asked last, it gets
    what the others leave. The paper's heuristic puts it last, since it is the hardest.
    """
    if not (isinstance(classifier.order, str) and classifier.order == RAREST_FIRST):
        return classifier
    labels, counts = np.unique(truth, return_counts=True)
    order = labels[np.argsort(counts, kind="stable")].tolist()
    return _like(classifier, order=order)


def fitted_list(
    unfitted: "DecisionListClassifier",
    values: NDArray[np.float32],
    truth: NDArray[np.int64],
    groups: NDArray[np.int64] | None,
    domain: NDArray[np.int64] | None = None,
) -> BoostedList:
    """The list that learned from all rows, or the mean of those that leave one domain out.

    Rows have a domain (n,), -1 for those that all lists learn from.
    What one list believes because of where a map comes from, those that have not seen such maps
    contradict: whole spaces flip between lists, and rarely in most of them at once.
    """
    remaining = without_a_domain(truth, domain)
    if len(remaining) == 1:  # all rows: a mask would copy them
        found: BoostedList = _like(unfitted).fit(values, truth, groups=groups).boosted_list_
        return found
    lists = []
    for seen in remaining:
        some = None if groups is None else groups[seen]
        lists.append(_like(unfitted).fit(values[seen], truth[seen], groups=some).boosted_list_)
    return list_average(lists)


def without_a_domain(
    truth: NDArray[np.int64], domain: NDArray[np.int64] | None
) -> list[NDArray[np.bool_]]:
    """The rows that remain without each domain, where all labels do; all rows if that is one."""
    everything = np.ones(len(truth), np.bool_)
    if domain is None:
        return [everything]
    remaining = [domain != number for number in np.unique(domain[domain >= 0])]
    n_labels = len(np.unique(truth))
    whole = [seen for seen in remaining if len(np.unique(truth[seen])) == n_labels]
    return whole if len(whole) > 1 else [everything]


def held_out_lists(
    unfitted: "DecisionListClassifier",
    features: NDArray[np.float32],
    truth: NDArray[np.int64],
    groups: NDArray[np.int64],
    progress: Progress,
    name: str,
    domain: NDArray[np.int64] | None = None,
) -> dict[int, BoostedList]:
    """For each group a list that has not seen it, in the order, of labels, of the one given.

    With domains (n,), each is the mean of lists that leave one of them out.
    """
    lists = {}
    folds = np.unique(groups).tolist()
    with progress.stage(name) as stage:
        for count, fold in enumerate(folds, start=1):
            seen = groups != fold
            order = [label for label in unfitted.order if (truth[seen] == label).any()]
            if len(order) < 2:
                raise InputError(
                    "out-of-fold scores need at least two labels outside every group; "
                    "use fewer folds or learn_on='in-sample'"
                )
            lists[fold] = fitted_list(
                _like(unfitted, order=order),
                features[seen],
                truth[seen],
                None,
                None if domain is None else domain[seen],
            )
            stage.update(count / len(folds))
    return lists


def held_out_scores(
    fitted: BoostedList,
    unfitted: "DecisionListClassifier",
    features: NDArray[np.float32],
    truth: NDArray[np.int64],
    groups: NDArray[np.int64],
    n_labels: int,
    progress: Progress,
    name: str,
    domain: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """(N, K) log z of every row from a list of the same order that has not seen its group."""
    ordered = _in_the_order_of(fitted, unfitted)
    lists = held_out_lists(ordered, features, truth, groups, progress, name, domain)
    return _scores_of(lists, features, groups, n_labels)


def _in_the_order_of(
    fitted: BoostedList, unfitted: "DecisionListClassifier"
) -> "DecisionListClassifier":
    """An estimator that asks for labels in the order that another one has chosen."""
    return _like(unfitted, order=fitted.classes[fitted.order].tolist())


def _context_means(
    cells: TrainingCells, scores: NDArray[np.float64], context_m: tuple[float, ...]
) -> NDArray[np.float32]:
    parts = []
    for m, part in enumerate(cells.by_map(scores)):
        resolution_m = cells.maps[m].grid.resolution_m
        parts.append(window_means(cells.layout(m), part, context_m, resolution_m))
    return np.concatenate(parts)
