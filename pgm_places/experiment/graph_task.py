"""Experiments on the nodes of graphs of one's own."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.labelled_items import TestGraph
from pgm_places.experiment.setup import GraphMethod, graph_labelers
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.task import Evidence, Task
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.unary.list_learning import with_explicit_order


def _learn(experiment: Experiment, sources: Sources) -> dict[str, StructuredLabeler]:
    """A fitted labeler for each method of the configuration; they share their classifier."""
    problems = [item.problem for item in sources.graphs]
    truths = [item.truth for item in sources.graphs]
    labelers = graph_labelers(experiment.config)
    learned: dict[str, StructuredLabeler] = {}
    with experiment.learning():
        for alone in (False, True):  # methods with unary = "none" see no classifier
            chosen = {n: item for n, item in labelers.items() if (item.classifier is None) == alone}
            if not chosen:
                continue
            shared = next(iter(chosen.values()))
            shared.set_params(classifier=_classifier(shared.classifier, problems, truths))
            methods = {name: item.backend for name, item in chosen.items()}
            learned |= shared.fit_methods(methods, problems, truths)
    return {name: learned[name] for name in labelers}


def _classifier(
    given: Any, problems: Sequence[LabelingProblem], truths: Sequence[NDArray[np.int64]]
) -> Any:
    """The classifier in its order of labels; None where there is nothing to classify, or all said.

    The order is that of frequency among all labelled nodes.
    """
    told = [problem.unary is not None for problem in problems]
    if any(told) and not all(told):
        raise ConfigError("give probabilities or node features for all graphs, not for some")
    if given is None or all(told):
        return None
    truth = np.concatenate(truths)
    return with_explicit_order(given, truth[truth >= 0])


def _evidence(
    _experiment: Experiment, labelers: Mapping[str, StructuredLabeler], item: SourceGraph
) -> Evidence:
    def label(name: str) -> Sequence[Labeling]:
        return [labelers[name].label(item.problem, truth=item.truth)]

    tested = TestGraph(item.name, item.problem.graph, item.truth, item.building)
    return Evidence([tested], label)


def _method(config: ExperimentConfig, name: str, labeler: StructuredLabeler) -> GraphMethod:
    [unary] = [method.unary for method in config.methods if method.id == name]
    return GraphMethod(labeler.backend_, unary)


GRAPHS = Task(graph_labelers, _learn, "graphs", _evidence, _method)
