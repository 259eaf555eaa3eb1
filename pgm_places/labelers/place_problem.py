"""What a method of a PlaceLabeler is given to label: the cells of a map with their scores."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import sealed
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.problem import LabelingProblem
from pgm_places.unary.halls import HallNames
from pgm_places.unary.map_model import CellScores, UnaryModel
from pgm_places.unary.options import HallsAs

__all__ = ["cells_problem", "shown_names"]


def shown_names(names: tuple[str, ...], model: UnaryModel, halls: HallsAs) -> tuple[str, ...]:
    """The labels of results: those that were learned and, if the model knows it, the hall."""
    return HallNames((*names, "hall")).shown(halls) if model.knows_halls else names


def cells_problem(
    graph: LabelGraph,
    label_names: tuple[str, ...],
    scores: CellScores,
    unary: str,
    known: NDArray[np.int64] | None = None,
) -> LabelingProblem:
    """The problem of the cells; ``unary`` is ``laser``, ``context``, ``space`` or ``floor``."""
    values = getattr(scores, unary)
    if values is None:
        raise InputError(f"the scores hold no {unary!r}; ask for those of a method that uses them")
    return LabelingProblem(
        graph,
        label_names,
        unary=values,
        node_features=(
            None
            if scores.node_features is None
            else sealed(np.asarray(scores.node_features, np.float64))
        ),
        known=known,
    )
