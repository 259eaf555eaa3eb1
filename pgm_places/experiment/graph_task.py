"""Experiments on the nodes of graphs of one's own."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.evaluated_items import EvalGraph
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.setup import GraphMethod, graph_labelers, one_method
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.task import ScoredTest, Tested
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.unary.list_learning import with_explicit_order


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


class GraphTask:
    """The nodes of graphs of one's own."""

    tested: ClassVar[Tested] = "graphs"

    def __init__(self, config: ExperimentConfig) -> None:
        self.config, self.labelers = config, graph_labelers(config)

    def check_savable(self) -> None:
        """A model has one method."""
        one_method(self.config, "graphs")

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, StructuredLabeler]:
        """The labelers share their classifier; methods with ``unary = "none"`` have none."""
        problems = [item.problem for item in sources.graphs]
        truths = [item.truth for item in sources.graphs]
        learned: dict[str, StructuredLabeler] = {}
        with experiment.learning():
            for alone in (False, True):
                chosen = {
                    name: item
                    for name, item in self.labelers.items()
                    if (item.classifier is None) == alone
                }
                if not chosen:
                    continue
                shared = next(iter(chosen.values()))
                shared.set_params(classifier=_classifier(shared.classifier, problems, truths))
                methods = {name: item.backend for name, item in chosen.items()}
                learned |= shared.fit_methods(methods, problems, truths)
        return {name: learned[name] for name in self.labelers}

    def scored(
        self,
        _experiment: Experiment,
        labelers: Mapping[str, StructuredLabeler],
        source: SourceGraph,
    ) -> ScoredTest:
        """A graph, which each labeler scores by itself."""

        def label(name: str) -> Sequence[Labeling]:
            return [labelers[name].label(source.problem, truth=source.truth)]

        item = EvalGraph(source.name, source.problem.graph, source.truth, source.building)
        return ScoredTest([item], label)

    def method(self, name: str, labeler: StructuredLabeler) -> GraphMethod:
        """The labeler's only one."""
        [unary] = [method.unary for method in self.config.methods if method.id == name]
        return GraphMethod(labeler.backend_, unary)
