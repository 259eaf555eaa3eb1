"""Methods that a configuration names by module and class."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pgm_places import Labeling, LabelingProblem, Status
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare


@dataclass(frozen=True)
class FirstLabel:
    """A method without an entry point."""

    def infer(self, problem: LabelingProblem) -> Labeling:
        return Labeling(np.zeros(problem.graph.n_nodes, np.int64), Status.CONVERGED)


def test_a_class_of_a_module_is_compared_without_an_entry_point(tmp_path: Path) -> None:
    half = {"generated": 1, "half": "left"}
    content = {
        "resolution_m": 0.4,
        "labels": {"names": ["corridor", "room", "doorway"]},
        "classifier": {"n_rounds": 2},
        "train": [half],
        "test": [{**half, "half": "right"}],
        "methods": [{"name": f"{__name__}:FirstLabel", "unary": "laser"}],
    }
    found = compare(Experiment(parse_config(content), tmp_path))
    assert [method.id for method in found.methods] == ["FirstLabel"]
    assert [method["name"] for method in found.config["methods"]] == [f"{__name__}:FirstLabel"]
