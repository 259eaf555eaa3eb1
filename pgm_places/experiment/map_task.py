"""Experiments on the cells of maps."""

from collections.abc import Mapping, Sequence

import numpy as np

from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.doors import door_scores
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.floor_teaching import taught_floor
from pgm_places.experiment.labelled_items import TestMap
from pgm_places.experiment.setup import check_labeler, make_labeler
from pgm_places.experiment.sources import Sources
from pgm_places.experiment.task import Evidence, Task
from pgm_places.experiment.taught import taught_labeler
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.unary.halls import HallNames

__all__ = ["CELLS", "tested_map"]


def _learn(experiment: Experiment, sources: Sources) -> dict[str, PlaceLabeler]:
    """The labeler of all methods, fitted on the maps, or trained further on them."""
    maps = sources.maps
    if experiment.config.base_model is not None:
        labeler = taught_labeler(experiment, maps)
        return dict.fromkeys(labeler.methods_, labeler)
    labeler, progress = make_labeler(experiment.config), experiment.progress
    with experiment.learning():
        if labeler.floor is not None:
            names, options = labeler.label_names, experiment.config.floor
            labeler.floor = taught_floor(labeler.floor, maps, names, options, progress)
        labeler = labeler.fit(
            maps,
            feature_cache=experiment.feature_cache,
            n_threads=experiment.n_threads,
            progress=progress,
        )
    return dict.fromkeys(labeler.methods_, labeler)


def _evidence(
    experiment: Experiment, labelers: Mapping[str, PlaceLabeler], item: LabelledMap
) -> Evidence:
    labeler = next(iter(labelers.values()))
    hall_names = HallNames.among(experiment.config.labels.names)
    if hall_names is not None:
        item = hall_names.fold(item, labeler.halls)
    with experiment.timed("score cells"):
        graph, scores = labeler.scores(
            item.grid,
            mask=item.cells,
            n_threads=experiment.n_threads,
            progress=experiment.progress,
        )
    assert isinstance(graph.layout, GridLayout)  # from_grid made it
    tested, truth = tested_map(item, graph.layout), item.truth(graph)

    def label(name: str) -> Sequence[Labeling]:
        return [labeler.infer(graph, scores, method=name, truth=truth)]

    def doors(name: str, found: Sequence[Labeling], doorway: int) -> tuple[DoorScores, ...]:
        model = labeler.unary_model_.space
        by_gates = labeler.method(name).unary in ("space", "floor")
        by_gates = by_gates and model is not None and model.gates is not None
        return (door_scores(tested, found[0], doorway, scores.spaces if by_gates else None),)

    return Evidence([tested], label, doors)


def tested_map(item: LabelledMap, layout: GridLayout, name: str | None = None) -> TestMap:
    """A map whose cells are labelled, under its own or another name."""
    window = np.ones(item.grid.shape, np.bool_) if item.window is None else item.window
    return TestMap(name or item.name, item.grid, item.labels, layout, window, item.building)


def _method(_config: ExperimentConfig, name: str, labeler: PlaceLabeler) -> PlaceMethod:
    return labeler.method(name)


CELLS = Task(check_labeler, _learn, "maps", _evidence, _method)
