"""Experiment tasks of each kind of nodes: cells of maps, steps of drives, nodes of graphs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError
from pgm_places.experiment.config import NO_MODEL, ExperimentConfig
from pgm_places.experiment.evaluated_items import (
    EvalDrive,
    EvalGraph,
    EvalMap,
    ScoredTest,
    Tested,
    door_scores,
    gate_scores,
    passage_scores,
)
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph
from pgm_places.experiment.setup import (
    GraphMethod,
    graph_labelers,
    joint_labeler,
    make_labeler,
    one_method,
    step_labeler,
    step_methods,
)
from pgm_places.experiment.sources import SourceDrive, Sources, counted_objects
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.io.input_file import sha256_of
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.labelers.tracking import map_of_scans
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.persistence.labelers import check_savable
from pgm_places.persistence.model_folder import MANIFEST
from pgm_places.spaces.doorways import DoorScores
from pgm_places.teaching.interactive_labeler import InteractiveLabeler
from pgm_places.teaching.paint import Paint
from pgm_places.trained import NAMES, model_folder, trained_labeler
from pgm_places.training.floor_teaching import taught_floor
from pgm_places.trajectories.trajectory import MappedDrive
from pgm_places.unary.halls import HallNames
from pgm_places.unary.list_learning import with_explicit_order


def taught_labeler(experiment: Experiment, maps: Sequence[LabelledMap]) -> PlaceLabeler:
    """The base model of the configuration, trained further on the training maps one by one.

    Without a base model (``"none"``), the first map trains a model, and must have two labels.
    ModelFileError if there is no such model; LabelError for labels missing in the configuration.
    """
    config = experiment.config
    labeler = _base_model(experiment)
    with experiment.learning():
        for map_ in maps:
            teacher = InteractiveLabeler(
                map_.grid, labeler, classes=config.labels.names, options=config.teaching
            )
            labels = map_.labels
            if map_.window is not None:
                labels = np.where(map_.window, labels, np.int16(-1))
            paint = Paint(labels, config.labels.names)
            labeler = teacher.learned(paint)
    assert labeler is not None  # there is at least one training map
    return labeler


def _base_model(experiment: Experiment) -> PlaceLabeler | None:
    name = str(experiment.config.base_model)
    if name == NO_MODEL:
        return None
    folder = model_folder(name if name in NAMES else experiment.resolve(name))
    labeler = trained_labeler(folder)
    experiment.inputs[f"{name}/{MANIFEST}"] = sha256_of(folder / MANIFEST)
    return labeler


def tested_map(item: LabelledMap, layout: GridLayout, name: str | None = None) -> EvalMap:
    """An evaluated map, with its own or another name."""
    window = np.ones(item.grid.shape, np.bool_) if item.window is None else item.window
    return EvalMap(name or item.name, item.grid, item.labels, layout, window, item.building)


class CellTask:
    """Labelling the cells of maps."""

    tested: ClassVar[Tested] = "maps"

    def __init__(self, config: ExperimentConfig) -> None:
        self.labeler = make_labeler(config) if config.base_model is None else None

    def check_savable(self) -> None:
        """Check that the labeler can be saved; a base model can."""
        if self.labeler is not None:
            check_savable(self.labeler)

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, PlaceLabeler]:
        """A labeler with all methods, fitted on the maps or trained further on them."""
        maps, labeler = sources.maps, self.labeler
        if labeler is None:
            labeler = taught_labeler(experiment, maps)
            return dict.fromkeys(labeler.methods_, labeler)
        with experiment.learning():
            if labeler.floor is not None:
                names, steps = labeler.label_names, experiment.config.floor.steps
                labeler.floor = taught_floor(labeler.floor, maps, names, steps)
            labeler.fit(maps, feature_cache=experiment.feature_cache)
        return dict.fromkeys(labeler.methods_, labeler)

    def scored(
        self, experiment: Experiment, labelers: Mapping[str, PlaceLabeler], source: LabelledMap
    ) -> ScoredTest:
        """A map with the scores of its cells."""
        labeler = next(iter(labelers.values()))
        hall_names = HallNames.among(experiment.config.labels.names)
        if hall_names is not None:
            source = hall_names.fold(source, labeler.halls)
        with experiment.timed("score cells"):
            graph, scores = labeler.scores(source.grid, mask=source.cells)
        item, truth = tested_map(source, graph.grid_layout), source.truth(graph)

        def label(name: str) -> Sequence[Labeling]:
            return [labeler.infer(graph, scores, method=name, truth=truth)]

        def doors(labelings: Sequence[Labeling], doorway: int) -> tuple[DoorScores, ...]:
            return (door_scores(item, labelings[0], doorway),)

        def gates(doorway: int) -> tuple[DoorScores, ...]:
            model = labeler.unary_model_.space
            if model is None or model.gates is None or scores.spaces is None:
                return ()
            return (gate_scores(item, scores.spaces, doorway),)

        return ScoredTest([item], label, doors, gates)

    def method(self, name: str, labeler: PlaceLabeler) -> PlaceMethod:
        """One of the labeler's methods."""
        return labeler.method(name)


class _DriveTask:
    """Common parts of the tasks with drives: a labeler for each method."""

    tested: ClassVar[Tested] = "drives"

    def __init__(self, config: ExperimentConfig) -> None:
        self.config, self.methods = config, step_methods(config)

    def check_savable(self) -> None:
        """A model has one method."""
        one_method(self.config, "drives")

    def method(self, _name: str, labeler: TrajectoryLabeler | JointLabeler) -> PlaceMethod:
        """The labeler's only method."""
        return PlaceMethod(labeler.method_, "laser")


class StepTask(_DriveTask):
    """Labelling the steps of drives."""

    def __init__(self, config: ExperimentConfig) -> None:
        super().__init__(config)
        self.labeler = step_labeler(config)

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, TrajectoryLabeler]:
        """Fitted labelers with one list, trained on the same held-out scores."""
        names = counted_objects(sources.drives)
        counts = [drive.count_columns(names) for drive in sources.drives]
        extra = [columns for columns in counts if columns is not None]
        with experiment.learning():
            learned = self.labeler.set_params(extra_names=tuple(names)).fit_methods(
                self.methods,
                sources.maps,
                [drive.trajectory for drive in sources.drives],
                extra=extra or None,
                known_map=[drive.grid for drive in sources.drives],
            )
        return {**learned}

    def scored(
        self,
        experiment: Experiment,
        labelers: Mapping[str, TrajectoryLabeler],
        source: SourceDrive,
    ) -> ScoredTest:
        """A drive with the scores of its steps."""
        path, first = source.trajectory, next(iter(labelers.values()))
        extra = source.count_columns(first.scan_model_.extra_names)
        if extra is None and source.counts is not None:
            raise ConfigError(f"{source.name}: the training drives have no counts; remove counts")
        with experiment.timed("score steps"):
            scores = first.scores(path, known_map=source.grid, extra=extra)
            grid = source.grid if source.grid is not None else map_of_scans(path)
        item = EvalDrive(path.name, path, grid)

        def label(name: str) -> Sequence[Labeling]:
            return [labelers[name].infer(path, scores, map_prior=source.prior, truth=path.labels)]

        def doors(labelings: Sequence[Labeling], doorway: int) -> tuple[DoorScores, ...]:
            return (passage_scores(item, labelings[0], doorway),)

        return ScoredTest([item], label, doors)


class StepAndCellTask(_DriveTask):
    """Labelling the steps of drives together with the cells of their maps."""

    def __init__(self, config: ExperimentConfig) -> None:
        super().__init__(config)
        self.labeler = joint_labeler(config)

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, JointLabeler]:
        """Fitted labelers with the same two lists."""
        pairs = [MappedDrive(_map_of(drive), drive.trajectory) for drive in sources.drives]
        with experiment.learning():
            return {**self.labeler.fit_methods(self.methods, pairs, sources.maps)}

    def scored(
        self, experiment: Experiment, labelers: Mapping[str, JointLabeler], source: SourceDrive
    ) -> ScoredTest:
        """A drive and its map, with the scores of steps and cells."""
        path, known, first = source.trajectory, _map_of(source), next(iter(labelers.values()))
        with experiment.timed("score steps"):
            scores = first.scores(known.grid, path, mask=known.cells)
        cells = scores.graph.cells
        assert cells is not None
        on_map = tested_map(known, cells.grid_layout, f"{path.name}: cells")

        def label(name: str) -> Sequence[Labeling]:
            joint = labelers[name].infer(scores)
            assert joint.cells is not None and joint.steps is not None
            # Score and history are for all nodes; they are reported with the cells.
            return [joint.cells, replace(joint.steps, score=None, bound=None, info={})]

        return ScoredTest([on_map, EvalDrive(f"{path.name}: steps", path, known.grid)], label)


def _map_of(drive: SourceDrive) -> LabelledMap:
    assert drive.map is not None  # checked by ExperimentConfig
    return drive.map


def _classifier(
    classifier: Any, problems: Sequence[LabelingProblem], truths: Sequence[NDArray[np.int64]]
) -> Any:
    """The classifier with labels ordered by frequency; None without one, or for given unaries."""
    has_unary = [problem.unary is not None for problem in problems]
    if any(has_unary) and not all(has_unary):
        raise ConfigError("probabilities must be given for all graphs or for none")
    if classifier is None or all(has_unary):
        return None
    truth = np.concatenate(truths)
    return with_explicit_order(classifier, truth[truth >= 0])


class GraphTask:
    """Labelling the nodes of user-defined graphs."""

    tested: ClassVar[Tested] = "graphs"

    def __init__(self, config: ExperimentConfig) -> None:
        self.config, self.labelers = config, graph_labelers(config)

    def check_savable(self) -> None:
        """A model has one method."""
        one_method(self.config, "graphs")

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, StructuredLabeler]:
        """Fitted labelers with one classifier; methods with ``unary = "none"`` have none."""
        problems = [graph.problem for graph in sources.graphs]
        truths = [graph.truth for graph in sources.graphs]
        learned: dict[str, StructuredLabeler] = {}
        with experiment.learning():
            for alone in (False, True):
                chosen = {
                    name: graph
                    for name, graph in self.labelers.items()
                    if (graph.classifier is None) == alone
                }
                if not chosen:
                    continue
                shared = next(iter(chosen.values()))
                shared.set_params(classifier=_classifier(shared.classifier, problems, truths))
                methods = {name: graph.backend for name, graph in chosen.items()}
                learned |= shared.fit_methods(methods, problems, truths)
        return {name: learned[name] for name in self.labelers}

    def scored(
        self,
        _experiment: Experiment,
        labelers: Mapping[str, StructuredLabeler],
        source: SourceGraph,
    ) -> ScoredTest:
        """A graph; each labeler computes its own scores."""

        def label(name: str) -> Sequence[Labeling]:
            return [labelers[name].label(source.problem, truth=source.truth)]

        item = EvalGraph(source.name, source.problem.graph, source.truth, source.building)
        return ScoredTest([item], label)

    def method(self, name: str, labeler: StructuredLabeler) -> GraphMethod:
        """The labeler's only method."""
        [unary] = [method.unary for method in self.config.methods if method.id == name]
        return GraphMethod(labeler.backend_, unary)
