"""A right call of every method and of the options of the labelers, for tests that spoil a part."""

from collections.abc import Callable
from typing import Any

import numpy as np

import pgm_places as p
from tests.labelers.test_contract import CASES, NAMES, TRUTH, chain
from tests.labelers.test_joint_labeler import fitted as joint_labeler
from tests.labelers.test_joint_labeler import unfitted as unfitted_joint


def labeler_calls(t: Any) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """By name: what is called, and the arguments by name; made of the things of the tests."""
    masks = np.ones(t.grid.shape, np.bool_)
    n_free = int(t.grid.free.sum())
    scores_of = t.places.scores(t.grid)
    step_scores = t.steps.scores(t.drive, known_map=t.grid)
    chain_scores = t.structured.scores(chain(0))
    two = {"X": [chain(0), chain(1)], "y": [TRUTH, TRUTH]}
    quick = {"n_threads": 1, "progress": None}

    def fresh(case: str) -> Callable[..., Any]:
        return lambda **given: CASES[case].labeler().fit(**given)

    def options(labeler: Any) -> Callable[..., Any]:
        return lambda **given: labeler().set_params(**given).check_options()

    return {
        "StructuredLabeler.fit": (fresh("structured"), {**two, "sample_weight": None}),
        "StructuredLabeler.infer": (
            t.structured.infer,
            {"problem": chain(0), "scores": chain_scores, "truth": TRUTH},
        ),
        "StructuredLabeler.label": (t.structured.label, {"problem": chain(0), "truth": TRUTH}),
        "StructuredLabeler.label_many": (t.structured.label_many, {"X": two["X"]}),
        "StructuredLabeler.predict": (t.structured.predict, {"X": two["X"]}),
        "StructuredLabeler.problem": (t.structured.problem, {"problem": chain(0)}),
        "StructuredLabeler.score": (t.structured.score, two),
        "StructuredLabeler.scores": (t.structured.scores, {"problem": chain(0)}),
        "StructuredLabeler options": (
            options(p.StructuredLabeler),
            {"backend": "potts", "classifier": None, "learn_on": "in-sample", "n_folds": 3}
            | {"min_probability": 0.1, "metric": "mcc"},
        ),
        "PlaceLabeler.label": (
            t.places.label,
            {"grid": t.grid, "method": "potts", "mask": masks}
            | {"truth": np.zeros(n_free, np.int64), **quick},
        ),
        "PlaceLabeler.scores": (
            t.places.scores,
            {"grid": t.grid, "mask": masks, "methods": ["potts"], "lean": True}
            | {"known": t.known.labels, "own": None, **quick},
        ),
        "PlaceLabeler.problem": (
            t.places.problem,
            {"grid": t.grid, "method": "potts", "mask": masks, **quick},
        ),
        "PlaceLabeler.infer": (
            t.places.infer,
            {"graph": scores_of[0], "scores": scores_of[1], "method": "potts"}
            | {"truth": np.zeros(n_free, np.int64)},
        ),
        "PlaceLabeler.problem_of": (
            t.places.problem_of,
            {"graph": scores_of[0], "scores": scores_of[1], "method": t.places.method()}
            | {"known": np.full(n_free, -1)},
        ),
        "PlaceLabeler.method": (t.places.method, {"name": "potts"}),
        "PlaceLabeler.score": (t.places.score, {"maps": [t.known], "method": "potts"}),
        "PlaceLabeler options": (
            options(lambda: p.PlaceLabeler(NAMES)),
            {"label_names": NAMES, "methods": ["potts"], "sensor": p.Sensor(), "classifier": None}
            | {"connectivity": 8, "context_m": (), "space": None, "learn_on": "in-sample"}
            | {"n_folds": 2, "n_node_features": 3, "max_examples_per_map": 100, "features": ()}
            | {"halls": "corridor", "whole_spaces": True, "doorway_depth_m": 1.0, "floor": None},
        ),
        "PlaceMethod": (p.PlaceMethod, {"backend": t.method, "unary": "laser"}),
        "TrajectoryLabeler.label": (
            t.steps.label,
            {"trajectory": t.drive, "known_map": t.grid, "map_prior": None, "extra": None}
            | {"truth": np.zeros(6, np.int64), **quick},
        ),
        "TrajectoryLabeler.scores": (
            t.steps.scores,
            {"trajectory": t.drive, "known_map": t.grid, "extra": None, **quick},
        ),
        "TrajectoryLabeler.infer": (
            t.steps.infer,
            {"trajectory": t.drive, "scores": step_scores, "map_prior": None}
            | {"truth": np.zeros(6, np.int64)},
        ),
        "TrajectoryLabeler.online": (
            p.trained_tracker().online,
            {"geometry": p.ScanGeometry.full_circle(36, range_max_m=8.0), "known_map": t.grid}
            | {"map_prior": None},
        ),
        "TrajectoryLabeler.from_places": (
            p.TrajectoryLabeler.from_places,
            {"places": t.places, "every_m": 0.1},
        ),
        "TrajectoryLabeler options": (
            options(lambda: p.TrajectoryLabeler(NAMES)),
            {"label_names": NAMES, "method": "hmm", "every_m": 0.1, "sensor": p.Sensor()}
            | {"beams": p.TrajectoryLabeler(NAMES).beams, "classifier": None, "n_folds": 2}
            | {"n_runs": 3, "seed": 0, "features": (), "extra_names": (), "loop_m": 0.0}
            | {"floor": None},
        ),
        "JointLabeler.label": (
            joint_labeler().label,
            {"grid": t.grid, "drive": t.drive, "mask": masks, **quick},
        ),
        "JointLabeler.scores": (
            joint_labeler().scores,
            {"grid": t.grid, "drive": t.drive, "mask": masks, **quick},
        ),
        "JointLabeler options": (
            options(unfitted_joint),
            {"label_names": NAMES, "method": "potts", "link_weight": "fitted"}
            | {"places": unfitted_joint().places, "steps": unfitted_joint().steps},
        ),
    }
