"""Experiments on the cells of maps, and labelers taught further on each of them."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from pgm_places.experiment.config import NO_MODEL, ExperimentConfig
from pgm_places.experiment.doors import door_scores, gate_scores
from pgm_places.experiment.evaluated_items import EvalMap
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.floor_teaching import taught_floor
from pgm_places.experiment.setup import make_labeler
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.task import ScoredTest, Tested
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.io.input_file import sha256_of
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.persistence.model_folder import MANIFEST
from pgm_places.persistence.place_labeler import check_savable
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.teaching.interactive_labeler import InteractiveLabeler
from pgm_places.teaching.paint import Paint
from pgm_places.trained import NAMES, model_folder, trained_labeler
from pgm_places.unary.halls import HallNames


def taught_labeler(experiment: Experiment, maps: Sequence[LabelledMap]) -> PlaceLabeler:
    """The base model of the configuration, taught the labels of training maps in their order.

    Without a base model (``"none"``), only the first map is learned from.

    Raises
    ------
    ModelFileError
        There is no such model.
    LabelError
        A label of the model is not among the configuration's; without a model, the first map has
        fewer than two labels.
    """
    config = experiment.config
    labeler = _base_model(experiment)
    with experiment.learning():
        for item in maps:
            teacher = InteractiveLabeler(
                item.grid, labeler, classes=config.labels.names, options=config.teaching
            )
            labels = item.labels
            if item.window is not None:
                labels = np.where(item.window, labels, np.int16(-1))
            paint = Paint(labels, config.labels.names)
            labeler = teacher.learned(paint)
    assert labeler is not None  # there is at least one training map
    return labeler


def _base_model(experiment: Experiment) -> PlaceLabeler | None:
    name = str(experiment.config.base_model)
    if name == NO_MODEL:
        return None
    folder = model_folder(name if name in NAMES else experiment.resolve(name))
    found = trained_labeler(folder)
    experiment.inputs[f"{name}/{MANIFEST}"] = sha256_of(folder / MANIFEST)
    return found


def tested_map(item: LabelledMap, layout: GridLayout, name: str | None = None) -> EvalMap:
    """A map whose cells are labelled, under its own or another name."""
    window = np.ones(item.grid.shape, np.bool_) if item.window is None else item.window
    return EvalMap(name or item.name, item.grid, item.labels, layout, window, item.building)


class CellTask:
    """The cells of maps."""

    tested: ClassVar[Tested] = "maps"

    def __init__(self, config: ExperimentConfig) -> None:
        self.labeler = make_labeler(config) if config.base_model is None else None

    def check_savable(self) -> None:
        """A base model has been saved before."""
        if self.labeler is not None:
            check_savable(self.labeler)

    def learn(self, experiment: Experiment, sources: Sources) -> dict[str, PlaceLabeler]:
        """The labeler of all methods, fitted on the maps, or trained further on them."""
        maps, labeler = sources.maps, self.labeler
        if labeler is None:
            labeler = taught_labeler(experiment, maps)
            return dict.fromkeys(labeler.methods_, labeler)
        with experiment.learning():
            if labeler.floor is not None:
                names, options = labeler.label_names, experiment.config.floor
                labeler.floor = taught_floor(labeler.floor, maps, names, options)
            labeler.fit(maps, feature_cache=experiment.feature_cache)
        return dict.fromkeys(labeler.methods_, labeler)

    def scored(
        self, experiment: Experiment, labelers: Mapping[str, PlaceLabeler], source: LabelledMap
    ) -> ScoredTest:
        """A map, its cells scored by the lists."""
        labeler = next(iter(labelers.values()))
        hall_names = HallNames.among(experiment.config.labels.names)
        if hall_names is not None:
            source = hall_names.fold(source, labeler.halls)
        with experiment.timed("score cells"):
            graph, scores = labeler.scores(source.grid, mask=source.cells)
        item, truth = tested_map(source, graph.grid_layout), source.truth(graph)

        def label(name: str) -> Sequence[Labeling]:
            return [labeler.infer(graph, scores, method=name, truth=truth)]

        def doors(found: Sequence[Labeling], doorway: int) -> tuple[DoorScores, ...]:
            return (door_scores(item, found[0], doorway),)

        def gates(doorway: int) -> tuple[DoorScores, ...]:
            model = labeler.unary_model_.space
            if model is None or model.gates is None or scores.spaces is None:
                return ()
            return (gate_scores(item, scores.spaces, doorway),)

        return ScoredTest([item], label, doors, gates)

    def method(self, name: str, labeler: PlaceLabeler) -> PlaceMethod:
        """One of the labeler's methods."""
        return labeler.method(name)
