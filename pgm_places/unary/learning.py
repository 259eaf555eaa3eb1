"""Training the unary model: boosted lists on the cells of labelled maps, and held-out scores."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation.folds import map_buildings
from pgm_places.features.custom import Feature
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary import list_learning
from pgm_places.unary.cell_scorers import window_means
from pgm_places.unary.feature_table import FeatureTables
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.list_learning import Extra, Lists, SpaceLists, Stages
from pgm_places.unary.map_model import EVEN, CellScores, UnaryModel, made_from, sees_spaces
from pgm_places.unary.options import MIXED, UNARIES, SpaceOptions, UnaryChoice, accuracy_by_part
from pgm_places.unary.space_model import learn_spaces
from pgm_places.unary.training_cells import TrainingCells

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier


@dataclass(frozen=True, eq=False)
class Halls:
    """The cells of circulation that are halls."""

    corridor: int  # the label that halls share with other circulation
    # (N,) the labelled cells of all maps, map after map, that are halls
    are_halls: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class LearnedUnary:
    """A fitted unary model and the out-of-fold scores to train structured methods on."""

    model: UnaryModel
    truths: list[NDArray[np.int64]]  # label index of the examples of each map
    laser: list[NDArray[np.float64]]  # their scores by laser lists
    # one per map, in the node order of its graph of labelled cells, if requested
    scores: list[CellScores] | None
    choice: UnaryChoice | None = None  # the chosen unary, if there were candidates


@dataclass(frozen=True, eq=False)
class UnaryLearner:
    """Training of a unary model: the list on scans, then the lists with context and spaces."""

    # sensor, classifier: the sensor to simulate and an unfitted list with its options
    sensor: Sensor
    classifier: "DecisionListClassifier"
    n_labels: int  # K
    # number of the features chosen first by boosting that structured models receive
    n_node_features: int = 30
    # half-widths in metres of the windows for the list with context; () for none
    context_m: tuple[float, ...] = ()
    # the list that also sees segments, gates and places; none by default
    space: SpaceOptions | None = None
    doorway: int | None = None  # the label of gates, if there is one
    halls: Halls | None = None  # which labelled cells are halls, to tell them from other corridors
    floor: FloorModel | None = None  # floor networks that were not trained on these maps
    # unaries to choose one from by held-out scores (:mod:`pgm_places.unary.options`); () for no
    # choice
    candidates: tuple[str, ...] = ()
    # unaries that the model must have, for any choice of the candidates
    wanted: Collection[str] = UNARIES
    # whether the returned scores come from the fitted lists, or from lists that were not trained on
    # the building of a cell, or on its contiguous block if there is only one building
    learn_on: str = "out-of-fold"
    # folds for out-of-fold scores: number of blocks, or maximum number of groups of buildings
    n_folds: int = 5
    # train the lists on a random sample of this many cells of each map
    max_examples_per_map: int | None = None
    # custom features, in addition to the laser's: see :mod:`pgm_places.features.custom`
    features: tuple[Feature, ...] = ()
    # whether all labelled cells are scored, to train structured methods on
    with_scores: bool = True
    # cache of the laser features of the maps; not used with custom features, whose code may change
    feature_cache: FeatureTables | None = None

    def fit(self, maps: Sequence[LabelledMap]) -> LearnedUnary:
        """The unary model fitted on the free, labelled cells of maps, and scores to learn from."""
        cells = TrainingCells.of(
            maps,
            self.sensor,
            self.features,
            n_folds=self.n_folds,
            limit=self.max_examples_per_map,
            seed=self.classifier.seed,
            wants_all=self.with_scores or bool(self.context_m or self.candidates) or self._mixes,
            feature_cache=self.feature_cache,
        )
        classifier = list_learning.with_explicit_order(self.classifier, cells.truth)
        # Context features come from held-out scores, too.
        held_out = self._from_held_out or bool(self.context_m or self.candidates) or self._mixes
        laser = self._lists("decision list", classifier, cells, held_out=held_out)
        context = self._in_context(laser, classifier) if self.context_m else None
        spaces = None if self.space is None else self._with_spaces(self.space, cells)
        stages = Stages(cells, laser, context, spaces, self.floor)
        choice = self._choice(stages) if self.candidates else None
        provided = self._provided(choice)
        columns = laser.fitted.features_in_order_of_choice(self.n_node_features)
        model = UnaryModel(
            self.sensor,
            laser.fitted,
            self.n_labels,
            np.asarray(columns, np.int64),
            self.context_m if "context" in provided else (),
            None if context is None or "context" not in provided else context.fitted,
            self.features,
            None if spaces is None or not sees_spaces(provided) else spaces.model,
            self.floor if "floor" in provided else None,
            stages.exponents if self._mixes else EVEN,
        )
        ends = np.searchsorted(cells.examples, np.cumsum(cells.sizes))[:-1]
        return LearnedUnary(
            model,
            np.split(cells.truth[cells.examples], ends),
            np.split(laser.scores_of_examples(held_out=self._from_held_out), ends),
            self._scores(stages, model, provided) if self.with_scores else None,
            choice,
        )

    def _provided(self, choice: UnaryChoice | None) -> set[str]:
        """The scores that the model must provide."""
        chosen = () if choice is None else (choice.unary,)
        provided = {"laser", *made_from({*self.wanted, *chosen})}
        return provided - {
            *(() if self.context_m else ("context",)),
            *(() if self.space is not None else ("space", "floor")),
            *(() if self.floor is not None else ("floor",)),
        }

    def _choice(self, stages: Stages) -> UnaryChoice:
        """The best candidate by held-out scores of buildings, or of blocks of one building."""
        cells, buildings = stages.cells, map_buildings(stages.cells.maps)
        names = sorted({*buildings})
        several = len(names) > 1
        numbers = np.repeat([names.index(name) for name in buildings], cells.sizes)
        parts = numbers if several else cells.groups
        accuracies = {}
        for name in self.candidates:
            scores = np.concatenate(stages.scores(name, held_out=True))
            accuracies[name] = accuracy_by_part(cells.truth, scores, parts, self.n_labels)
        return UnaryChoice.of(accuracies, "buildings" if several else "blocks")

    @property
    def _from_held_out(self) -> bool:
        """Whether scores are held-out scores."""
        return self.learn_on == "out-of-fold"

    @property
    def _mixes(self) -> bool:
        """Whether the mean of two lists may be needed, for which both are calibrated."""
        return self.space is not None and MIXED in {*self.wanted, *self.candidates}

    @property
    def _holds_out_others(self) -> bool:
        """Whether the lists with context and spaces are held out."""
        return (self.with_scores and self._from_held_out) or bool(self.candidates) or self._mixes

    def _in_context(self, laser: Lists, classifier: "DecisionListClassifier") -> Lists:
        """The stage of the list with context."""
        cells, parts = laser.cells, []
        for m, part in enumerate(cells.by_map(np.exp(laser.scores(held_out=True)))):
            resolution_m = cells.maps[m].grid.resolution_m
            scores = part[:, laser.fitted.classes[laser.fitted.sequence]]
            parts.append(window_means(cells.layout(m), scores, self.context_m, resolution_m))
        means = np.concatenate(parts)
        # Stumps: their votes on scans and on context can be cast apart, those of trees cannot.
        order = laser.fitted.classes[laser.fitted.order].tolist()
        return self._lists(
            "list with context",
            list_learning.like(classifier, order=order, max_depth=1, shrinkage=1.0),
            cells,
            held_out=self._holds_out_others,
            extra=lambda some: means[some],
        )

    def _with_spaces(self, options: SpaceOptions, cells: TrainingCells) -> SpaceLists:
        """The stage of the list with segments, gates and places."""
        spaces = learn_spaces(cells, self.doorway)
        if self.halls is not None:
            truth = np.where(self.halls.are_halls, self.n_labels, cells.truth)
            cells = replace(cells, truth=truth)
        lists = self._lists(
            "list with spaces",
            list_learning.with_explicit_order(options.classifier(), cells.truth),
            cells,
            held_out=self._holds_out_others,
            extra=spaces.columns,
            limit=options.max_examples_per_map,
            by_domain=True,
            n_labels=self.n_labels + (self.halls is not None),
        )
        return SpaceLists(lists, spaces, None if self.halls is None else self.halls.corridor)

    def _lists(
        self,
        name: str,
        unfitted: "DecisionListClassifier",
        cells: TrainingCells,
        *,
        held_out: bool,
        extra: Extra | None = None,
        limit: int | None = None,
        by_domain: bool = False,
        n_labels: int | None = None,
    ) -> Lists:
        """A list fitted on the examples and, if needed, a held-out list for each fold."""
        # With limit it is fitted on at most that many examples of each map; by_domain it is the
        # mean of lists that were fitted without one.
        some = slice(None) if limit is None else cells.some_examples(limit, unfitted.seed)
        examples = cells.examples[some]
        rows = list_learning.Rows(
            list_learning.with_extra(cells.features[some], examples, extra),
            cells.truth[examples],
            cells.groups[examples],
            cells.domain[examples] if by_domain else None,
        )
        tempered = unfitted.calibration == "temperature"
        if tempered:
            unfitted = list_learning.like(unfitted, calibration="none")
        fitted, of_fold = list_learning.cross_fitted(
            unfitted, rows, name, held_out=tempered or held_out
        )
        if tempered:
            fitted, of_fold = list_learning.with_temperatures(fitted, of_fold, rows)
        return Lists(fitted, of_fold, cells, n_labels or self.n_labels, extra)

    def _scores(self, stages: Stages, model: UnaryModel, provided: set[str]) -> list[CellScores]:
        """The scores of the labelled cells of each map."""
        cells = stages.cells
        tables: dict[str, list[NDArray[Any]]] = {
            name: stages.scores(name, held_out=self._from_held_out) for name in provided
        }
        tables["node_features"] = cells.by_map(_columns(cells, model.node_columns))
        of_maps: list[dict[str, Any]] = [
            {name: table[m] for name, table in tables.items()} for m in range(len(cells.maps))
        ]
        return [CellScores(**item, exponents=model.exponents) for item in of_maps]


def _columns(cells: TrainingCells, columns: NDArray[np.int64]) -> NDArray[np.float32]:
    """(N, D) some columns of all cells."""
    table = np.empty((len(cells.truth), len(columns)), np.float32)
    for some, values in cells.blocks():
        table[some] = values[:, columns]
    return table
