"""Decision lists learned from the cells of maps, with held-out scores."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pgm_places.floor.view import FloorScores
from pgm_places.inference.temperature import likeliest_temperature
from pgm_places.models.boosted_list import BoostedList
from pgm_places.unary import list_learning
from pgm_places.unary.cell_scorers import without_halls
from pgm_places.unary.floor_model import FloorModel, with_floor
from pgm_places.unary.map_model import LASER_SHARE, MIXED, log_mean
from pgm_places.unary.space_learning import LearnedSpaces
from pgm_places.unary.space_model import SpaceModel
from pgm_places.unary.training_cells import TrainingCells

# Columns (n, D) beside the cells' own features, for cells by their numbers.
Extra = Callable[[NDArray[np.int64]], NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Lists:
    """A list fitted on all examples and, where there are any, lists that have not seen a fold."""

    fitted: BoostedList
    of_fold: dict[int, BoostedList]
    cells: TrainingCells
    n_labels: int
    extra: Extra | None

    def scores(self, *, held_out: bool) -> NDArray[np.float64]:
        """(N, K) log z of all cells, from the fitted list or from those that have not seen them."""
        return self._held_out_scores if held_out else self._all_scores(held_out=False)

    @cached_property
    def _held_out_scores(self) -> NDArray[np.float64]:
        return self._all_scores(held_out=True)

    def _all_scores(self, *, held_out: bool) -> NDArray[np.float64]:
        found = np.empty((len(self.cells.truth), self.n_labels))
        for some, values in self.cells.blocks():
            found[some] = self._of(some, beside_extra(values, some, self.extra), held_out)
        return found

    def scores_of_examples(self, *, held_out: bool) -> NDArray[np.float64]:
        """(n, K) the same of the examples."""
        examples = self.cells.examples
        return self._of(examples, beside_extra(self.cells.features, examples, self.extra), held_out)

    def _of(
        self, some: NDArray[np.int64], values: NDArray[np.float32], held_out: bool
    ) -> NDArray[np.float64]:
        groups = self.cells.groups[some]
        everyone = dict.fromkeys(np.unique(groups).tolist(), self.fitted)
        lists = self.of_fold if held_out else everyone
        return list_learning.scores_of(lists, values, groups, self.n_labels)


@dataclass(frozen=True, eq=False)
class SpaceLists:
    """Lists that see spaces, with the gates that weigh what they say of doorways."""

    lists: Lists
    spaces: LearnedSpaces
    corridor: int | None

    @property
    def model(self) -> SpaceModel:
        """The model of all that was learned."""
        return self.spaces.model(self.lists.fitted, self.corridor)

    def scores(self, *, held_out: bool) -> NDArray[np.float64]:
        """(N, K) log z of all cells, halls among corridors, doorways weighed by their gates."""
        log_z = self.lists.scores(held_out=held_out)
        if self.corridor is not None:
            log_z, _ = without_halls(log_z, self.corridor)
        return self.spaces.scores(log_z)


@dataclass(frozen=True, eq=False)
class Stages:
    """The lists that were learned from some cells, and the networks beside them."""

    cells: TrainingCells
    laser: Lists
    context: Lists | None
    space: SpaceLists | None
    floor: FloorModel | None

    def scores(self, name: str, *, held_out: bool) -> list[NDArray[np.float64]]:
        """(n, K) what a unary says of the cells of each map."""
        if name == MIXED:
            laser, space = (self.scores(part, held_out=held_out) for part in ("laser", "space"))
            pairs = zip(laser, space, strict=True)
            return [log_mean(one, other, self.exponents) for one, other in pairs]
        if name != "floor":
            stage = getattr(self, name)
            return self.cells.by_map(stage.scores(held_out=held_out))
        assert self.floor is not None
        return [
            with_floor(log_z, self._seen[m], self.floor, self.cells.layout(m))
            for m, log_z in enumerate(self.scores("space", held_out=held_out))
        ]

    @cached_property
    def exponents(self) -> tuple[float, float]:
        """Of laser and space in their mean, by how likely each makes cells that it has not seen."""
        truths = self.cells.by_map(self.cells.truth)
        hot = [
            likeliest_temperature(
                [np.exp(part) for part in self.scores(name, held_out=True)], truths
            )
            for name in ("laser", "space")
        ]
        return LASER_SHARE / hot[0], (1.0 - LASER_SHARE) / hot[1]

    @cached_property
    def _seen(self) -> list[FloorScores]:
        assert self.floor is not None
        return [self.floor.scores(item.grid) for item in self.cells.maps]


def beside_extra(
    values: NDArray[np.float32], cells: NDArray[np.int64], extra: Extra | None
) -> NDArray[np.float32]:
    """(n, F) rows of cells with the columns beside them."""
    return values if extra is None else np.concatenate([values, extra(cells)], axis=1)
