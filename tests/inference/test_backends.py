"""Methods by name: the table, options, plugins, and the baseline without structure."""

import re
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest

from pgm_places import LabelGraph, Labeling, LabelingProblem, Status, build
from pgm_places.errors import ConfigError, ModelFileError
from pgm_places.inference.backends import BACKENDS, METHODS, Traits, backend_names, traits_of
from pgm_places.models.decoders import Decoder
from pgm_places.options import AtLeastZero, Positive, Whole, option_hints, option_values
from tests.refusals import refused


@dataclass(frozen=True)
class AlwaysFirst:
    """A third party's backend: label 0 everywhere."""

    times: int = 1

    def infer(self, problem: LabelingProblem) -> Labeling:
        return Labeling(np.zeros(problem.graph.n_nodes, np.int64), Status.CONVERGED)


def test_third_party_by_module_and_class() -> None:
    name = f"{__name__}:AlwaysFirst"
    assert build(name, {"times": 3}) == AlwaysFirst(3)
    wanted = r"has no option 'time'\. Did you mean 'times'"
    refused(ConfigError, wanted, build, name, {"time": 3})
    refused(ConfigError, "needs 'not_there'", METHODS.find, "not_there:Thing")
    wanted = "unknown method 'relaxaton'. Did you mean 'relaxation'?"
    with pytest.raises(ConfigError, match=re.escape(wanted)) as caught:
        build("relaxaton")
    assert all(name in str(caught.value) for name in backend_names())


def test_options_may_be_keywords() -> None:
    assert build("potts", weight=0.5) == build("potts", {"weight": 0.5})
    assert build("potts", {"weight": 0.5}, certify=True).certify
    refused(ConfigError, r"has no option 'wait'\. Did you mean 'weight'", build, "potts", wait=0.5)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("relaxation", {"iterations": 7}, {"max_iterations": 7}),
        ("amn", {"tolerance": 0.01}, {"learning_tolerance": 0.01}),
    ],
)
def test_options_of_stored_models_keep_their_meaning(
    name: str, old: dict[str, Any], new: dict[str, Any]
) -> None:
    assert option_values(METHODS.from_saved(name, old)) == option_values(build(name, new))
    refused(ConfigError, rf"has no option '{next(iter(old))}'\. Did you mean", build, name, old)


SHARED: dict[str, Any] = {
    "inference": Decoder,
    "certify": bool,
    "tolerance": AtLeastZero,
    "time_limit_s": Positive | None,
}
"""Keys that several methods may have, and what they take wherever they are."""


@pytest.mark.parametrize("name", list(BACKENDS))
def test_keys_take_the_same_in_all_methods(name: str) -> None:
    hints = option_hints(METHODS.find(name))
    for key in set(SHARED) & set(hints):
        assert hints[key] in (SHARED[key], Literal["auto"] | SHARED[key])
    limits = (Whole, Whole | None, Whole | Literal["auto"])
    assert hints.get("max_iterations", Whole) in limits


def test_independent_takes_the_best_label() -> None:
    graph = LabelGraph.from_edges(2, [(0, 1)])
    probabilities = np.array([[0.9, 0.1], [0.2, 0.8]])
    problem = LabelingProblem(graph, ["a", "b"], unary=np.log(probabilities))
    labeling = build("independent").infer(problem)
    assert labeling.labels.tolist() == [0, 1]
    assert labeling.status is Status.EXACT
    assert labeling.beliefs is not None
    np.testing.assert_allclose(labeling.beliefs, probabilities, rtol=0, atol=1e-12)
    assert labeling.gap == 0.0


def test_a_method_that_is_gone_names_the_one_to_use() -> None:
    refused(ConfigError, "no method 'space_field' any more; use 'potts'", build, "space_field")
    wanted = r"use 'potts' .* and train again"
    refused(ModelFileError, wanted, METHODS.from_saved, "space_field", {})


def test_a_stored_model_of_a_learner_that_is_gone_labels_on() -> None:
    assert METHODS.from_saved("amn", {"learner": "frank-wolfe"}).learner == "cutting-plane"
    with pytest.raises(ConfigError, match="learner must be 'auto', 'cutting-plane' or 'qp'"):
        build("amn", {"learner": "frank-wolfe"})


def test_a_method_declares_its_traits_as_one_record() -> None:
    assert traits_of(build(f"{__name__}:AlwaysFirst")) == Traits()
    assert traits_of(build("relaxation")).takes_single_precision
    assert traits_of(build("crf")).labelling_options == ("inference", "max_iterations", "certify")

    class OfAnEarlierVersion:
        chains_only = True

    with pytest.raises(ConfigError, match=r"OfAnEarlierVersion declares chains_only by itself; .*"):
        traits_of(OfAnEarlierVersion())
