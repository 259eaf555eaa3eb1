"""Learning from nothing but paint, in a second: a labeler for a kind of map nobody has seen yet."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.models.boosted_list import BoostedList
from pgm_places.progress import staged
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gate_features import gate_features
from pgm_places.teaching.cell_table import CellPaint, CellTable
from pgm_places.teaching.learning import POTTS
from pgm_places.teaching.lesson import TeachingOptions, chosen_cells
from pgm_places.unary.map_model import UnaryModel
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.space_learning import gate_list
from pgm_places.unary.space_model import SpaceModel

_SPACES = SpaceOptions(n_rounds=30, max_depth=3, calibration="none")
_LASER_ROUNDS, _NODE_FEATURES = 10, 30
_ONE_FOLD = 1  # gates of a single map leave nothing to calibrate by


def learned_alone(paint: CellPaint, table: CellTable, options: TeachingOptions) -> PlaceLabeler:
    """A labeler that has learned nothing but the paint.

    It has a list of trees that sees spaces, a short list of stumps on laser features, a list of
    gates where both doorways and other openings are painted, and a light Potts field.

    Raises
    ------
    LabelError
        Fewer than two classes are painted.
    """
    from pgm_places.models.decision_list import DecisionListClassifier

    names = paint.used
    if len(names) < 2:
        raise LabelError(
            "learning from paint alone needs at least two classes; painted so far: "
            f"{', '.join(names) or 'none'}"
        )
    painted, doorway = paint.on(names), _SPACES.doorway(names)
    with staged("learning the paint"):
        nodes = table.layout.from_raster(painted).astype(np.int64)
        lesson = chosen_cells(nodes, options)
        own = table.rows(lesson.nodes)
        order = np.argsort(np.bincount(nodes[nodes >= 0]), kind="stable").tolist()
        learn: dict[str, Any] = {"y": lesson.labels, "sample_weight": lesson.weights}
        stumps = DecisionListClassifier(_LASER_ROUNDS, order)
        laser = stumps.fit(own, **learn).boosted_list_
        gates = None if doorway is None else _gates(painted, doorway, table)
        space = SpaceModel(laser, gates, doorway)
        spaces = space.judged_candidates(table.gates, painted)
        trees = _SPACES.classifier().set_params(order=order)
        trees.fit(table.beside_spaces(lesson.nodes, spaces), **learn)
    columns = np.asarray(laser.features_in_order_of_choice(_NODE_FEATURES), np.int64)
    model = UnaryModel(
        table.sensor,
        laser,
        len(names),
        columns,
        features=table.features,
        space=replace(space, classifier=trees.boosted_list_),
    )
    labeler = PlaceLabeler(names, {"potts": POTTS}, table.sensor, features=table.features)
    return labeler.set_learned(
        unary_model_=model,
        methods_={"potts": POTTS},
        learn_seconds_={},
        resolution_m_=table.grid.resolution_m,
        movement_=None,
        label_names_=names,
    )


def _gates(painted: NDArray[np.int16], doorway: int, table: CellTable) -> BoostedList | None:
    """A list of gates from painted doorways, and from gates with other paint on them."""
    match = match_doors(table.gates, painted, doorway)
    truth = match.is_doorway.astype(np.int64)
    values = gate_features(table.gates).astype(np.float32)
    fold = np.full(len(truth), _ONE_FOLD)
    return gate_list(values, truth, fold, match.known | match.is_doorway)
