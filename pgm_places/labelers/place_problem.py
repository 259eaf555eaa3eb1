"""What a method of a PlaceLabeler is given to label: the cells of a map with their scores."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import sealed
from pgm_places.errors import InputError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.doorway_depth import with_doorway_depth
from pgm_places.labelers.whole_spaces import with_whole_spaces
from pgm_places.unary.halls import HallNames
from pgm_places.unary.map_model import CellScores, UnaryModel
from pgm_places.unary.options import HallsAs

__all__ = ["along_spaces", "cells_problem", "shown_names"]


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


def along_spaces(
    problem: LabelingProblem,
    scores: CellScores,
    doorway: int | None,
    doorway_depth_m: float | None,
    *,
    whole_spaces: bool,
) -> LabelingProblem:
    """The problem with doorways as deep as wanted, and with whole spaces, where these are seen."""
    layout = problem.graph.layout
    assert problem.unary is not None and isinstance(layout, GridLayout)  # scores of a map
    unary = problem.unary
    if doorway_depth_m is not None:
        assert doorway is not None  # the list of gates has learned it
        unary = with_doorway_depth(unary, scores.accepted_gates, layout, doorway, doorway_depth_m)
    if whole_spaces and scores.segments is not None:
        place, has_gates = None, scores.doorways is not None or scores.spaces is not None
        if problem.known is not None and has_gates:
            place = layout.from_raster(scores.accepted_gates.place)
        unary = with_whole_spaces(
            unary, scores.segments, layout, tuple(problem.label_names), problem.known, place
        )
    return problem if unary is problem.unary else problem.with_unary(sealed(unary))
