"""Maps labelled with networks that have not seen their buildings, and the shipped networks."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.floor_network.floors import N_FOLDS, network_file
from experiments.floor_network.sheets import LabelledPair, write_sheets
from experiments.robot_maps.catalogue import declared, robot_maps
from experiments.robot_maps.figures import MapFigures, measured, table, write_figures
from experiments.robot_maps.sources import Source
from pgm_places import save, trained_labeler
from pgm_places.floor.network import FloorNetwork
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.progress import Progress
from pgm_places.trained import DEFAULT, model_folder, stored_labeler
from pgm_places.unary.floor_model import FloorModel

LISTS = "adaboost"
"""The method of the shipped model that is the lists alone."""

VIEWS = 4
"""Sides from which each of the shipped networks looks at a map."""

DEPTHS_M = (None, 0.4)
"""How deep doorways are labelled: as learned, and as the labels of robots' maps have them."""

_VIEWS_ALONE = 8
"""The same for the one network that has not seen a building."""


def networks(kept: Path) -> list[FloorNetwork]:
    """The network of each fold: the running average of its weights, as it is shipped."""
    found = []
    for fold in range(N_FOLDS):
        with np.load(network_file(kept, fold), allow_pickle=False) as file:
            weights = {
                name.removeprefix("averaged/"): file[name]
                for name in file.files
                if name.startswith("averaged/")
            }
        found.append(FloorNetwork.unpacked(FloorNetwork(weights).packed()))
    return found


def with_networks(
    labeler: PlaceLabeler, some: list[FloorNetwork], views: int = VIEWS
) -> PlaceLabeler:
    """The labeler with networks for all its methods that see spaces, but for the lists alone."""
    floor = FloorModel(tuple(some), views_per_network=views)
    found = labeler.with_options(floor=floor)
    found.unary_model_ = replace(labeler.unary_model_, floor=floor)
    found.methods_ = found.methods = {
        name: replace(method, unary="floor") if name != LISTS and method.sees_spaces else method
        for name, method in labeler.methods_.items()
    }
    return found


def shipped_without() -> Callable[[str], PlaceLabeler]:
    """The shipped model for a map of DATA/robots, without the networks that learned its building.

    The one network that did not sees the map from eight sides.
    """
    labeler, maps = trained_labeler(), declared()
    assert labeler.unary_model_.floor is not None  # the shipped model has networks
    alone = [
        with_networks(labeler, [network], _VIEWS_ALONE)
        for network in labeler.unary_model_.floor.networks
    ]
    return lambda name: alone[maps[name].fold]


def measure(data: Path, kept: Path, progress: Progress) -> None:
    """Print the figures of robots' maps by kind, each with the network of its fold."""
    labeler, declaration = trained_labeler(), declared()
    labelers = [with_networks(labeler, [network], _VIEWS_ALONE) for network in networks(kept)]
    figures: dict[float | None, list[MapFigures]] = {depth: [] for depth in DEPTHS_M}
    pairs = []
    maps = list(robot_maps(data))
    with progress.stage("maps") as stage:
        for known, weight in maps:
            labeler = labelers[declaration[known.item.name].fold]
            grid = known.item.grid
            graph, scores = labeler.scores(grid, methods=[labeler.default_method])
            for depth, mine in figures.items():
                source = Source(labeler.with_options(doorway_depth_m=depth))
                found = source.decoded(grid, graph, scores)
                mine.append(measured(known, weight, found))
            pairs.append(LabelledPair(known, found.labels, mine[-1].cells.accuracy))
            stage.update(len(pairs) / len(maps), known.item.name)
    for depth, mine in figures.items():
        print(f"doorways {'as deep as learned' if depth is None else f'{depth} m deep'}:")
        print(table(mine))
        write_figures(kept / f"robots_{depth or 'learned'}.csv", mine)
    write_sheets(kept, pairs)


def ship(kept: Path) -> None:
    """Write the model ``default`` with all networks; its record says how they were trained."""
    stored = stored_labeler(DEFAULT)
    record = {**stored.record, "floor": {"command": "python -m experiments.floor_network"}}
    with np.load(network_file(kept, 0), allow_pickle=False) as file:
        record["floor"]["steps"] = int(file["steps"])
    save(with_networks(stored.item, networks(kept)), model_folder(DEFAULT), record=record)
