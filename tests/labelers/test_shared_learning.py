"""Methods that differ in how they label alone are learned once."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, build
from pgm_places.labelers.labeler import as_fitted, learned_with
from pgm_places.labelers.method import PlaceMethod
from pgm_places.labelers.place_learning import LabelledNodes, learn_methods
from pgm_places.models.amn import AssociativeMarkovNetwork
from pgm_places.unary.map_model import CellScores

NAMES = ("ground", "spot")


def named(**options: dict[str, Any]) -> dict[str, tuple[Any, str]]:
    """Networks by name, all with one unary."""
    return {name: (build("amn", given), "laser") for name, given in options.items()}


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The decoders of the networks that were fitted, in order."""
    asked: list[str] = []
    fit: Callable[..., Any] = AssociativeMarkovNetwork.fit

    def noted(self: Any, *args: Any, **keywords: Any) -> Any:
        asked.append(self.inference)
        return fit(self, *args, **keywords)

    monkeypatch.setattr(AssociativeMarkovNetwork, "fit", noted)
    return asked


def noisy(seed: int) -> tuple[LabelingProblem, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = (np.arange(36) % 6 > 2).astype(np.int64)
    unary = 0.8 * np.eye(2)[truth] + 0.5 * rng.normal(size=(36, 2))
    return LabelingProblem(LabelGraph.from_lattice((6, 6)), NAMES, unary), truth


def test_options_of_labelling_alone_need_no_learning_of_their_own() -> None:
    methods = named(
        cut={},
        lp={"inference": "lp"},
        sure={"inference": "lp", "certify": True, "max_iterations": 5},
        dearer={"C": 10.0},
        dearer_lp={"C": 10.0, "inference": "lp"},
    )
    assert learned_with(methods) == {"lp": "cut", "sure": "cut", "dearer_lp": "dearer"}


def test_what_learns_from_other_scores_or_in_another_way_learns_by_itself() -> None:
    network = build("amn")
    assert learned_with({"one": (network, "laser"), "other": (network, "space")}) == {}
    modes = {mode: (build("hmm", {"mode": mode}), "") for mode in ("filter", "viterbi")}
    assert learned_with(modes) == {"viterbi": "filter"}
    assert learned_with({**modes, "longer": (build("semi_markov"), "")}) == {"viterbi": "filter"}
    plain = {name: (build("potts"), "") for name in "ab"}
    assert learned_with(plain) == {}  # they learn nothing


def test_networks_that_have_learned_apart_share_nothing() -> None:
    """With a warm start they would go on from different weights."""
    fitted = [build("amn", {"warm_start": True}).fit(*zip(noisy(seed))) for seed in (0, 1)]
    assert learned_with({"a": (fitted[0], ""), "b": (fitted[1], "")}) == {}
    same = {"a": (fitted[0], ""), "b": (as_fitted(build("amn", {"certify": True}), fitted[0]), "")}
    assert learned_with(same) == {"b": "a"}


def test_places_learn_once_for_all_decoders(fits: list[str]) -> None:
    problem, truth = noisy(0)
    unary = problem.unary
    assert unary is not None
    scores = CellScores(laser=unary)
    nodes = LabelledNodes(NAMES, (problem.graph,), (truth,), [scores])
    methods = {
        name: PlaceMethod(build("amn", {"inference": name, "certify": name == "lp"}), "laser")
        for name in ("graph-cut", "lp")
    }
    found, seconds = learn_methods(methods, nodes, False)
    assert fits == ["graph-cut"]
    assert list(seconds) == ["graph-cut"]
    lp = found["lp"].backend
    assert (lp.inference, lp.certify) == ("lp", True)
    assert lp.node_weights is found["graph-cut"].backend.node_weights
    alone = build("amn", {"inference": "lp", "certify": True}).fit([problem], [truth])
    np.testing.assert_array_equal(lp.node_weights, alone.node_weights)
    np.testing.assert_array_equal(lp.infer(problem).labels, alone.infer(problem).labels)


def test_labelers_of_graphs_share_a_classifier_and_what_was_learned(fits: list[str]) -> None:
    from sklearn.linear_model import LogisticRegression

    problems, truths = zip(*map(noisy, range(3)), strict=True)
    seen = [LabelingProblem(p.graph, NAMES, node_features=p.unary) for p in problems]
    methods = {name: build("amn", {"inference": name}) for name in ("graph-cut", "icm")}
    whole = StructuredLabeler(classifier=LogisticRegression())
    found = whole.fit_methods({**methods, "potts": "potts"}, seen, truths)
    assert fits == ["graph-cut"]
    assert found["potts"] is whole
    assert found["icm"].backend.inference == found["icm"].backend_.inference == "icm"
    assert found["icm"].learn_seconds_ == 0 < found["graph-cut"].learn_seconds_
    assert found["icm"].classifier_ is found["potts"].classifier_
    alone = StructuredLabeler(methods["icm"], LogisticRegression()).fit(seen, truths)
    for one, other in zip(found["icm"].predict(seen), alone.predict(seen), strict=True):
        np.testing.assert_array_equal(one, other)
