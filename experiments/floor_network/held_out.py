"""Held-out scores: maps labelled by networks not trained on their building; shipped networks."""

from collections.abc import Callable, Sequence
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
from pgm_places.trained import DEFAULT, model_folder, stored_labeler, trained_floor
from pgm_places.unary.floor_model import FloorModel

LISTS = "adaboost"
"""The method of the shipped model that is the lists alone."""

_VIEWS, _VIEWS_ALONE = 16, 8
"""Number of views of a map by all shipped networks, and by those without its building."""

DEPTHS_M = (None, 0.4)
"""How deep doorways are labelled: as learned, and as the labels of robots' maps have them."""


def networks(kept: Path, *, continued: bool = False) -> list[tuple[FloorNetwork, ...]]:
    """The networks of each fold: the running average of the weights, as it is shipped.

    After continued training, the shipped network from which it began comes first.
    """
    folds: list[tuple[FloorNetwork, ...]] = []
    shipped = trained_floor().networks if continued else ()
    for fold in range(N_FOLDS):
        with np.load(network_file(kept, fold), allow_pickle=False) as file:
            weights = {
                name.removeprefix("averaged/"): file[name]
                for name in file.files
                if name.startswith("averaged/")
            }
        network = FloorNetwork.unpacked(FloorNetwork(weights).packed())
        folds.append((*shipped[fold : fold + 1], network))
    return folds


def with_networks(
    labeler: PlaceLabeler, networks: Sequence[FloorNetwork], n_views: int = _VIEWS_ALONE
) -> PlaceLabeler:
    """The labeler with networks for all its methods that see spaces, but for the lists alone."""
    floor = FloorModel(tuple(networks), views_per_network=n_views // len(networks))
    copy = labeler.with_options(floor=floor)
    copy.unary_model_ = replace(labeler.unary_model_, floor=floor)
    copy.methods_ = copy.methods = {
        name: replace(method, unary="floor") if name != LISTS and method.sees_spaces else method
        for name, method in labeler.methods_.items()
    }
    return copy


def shipped_without() -> Callable[[str], PlaceLabeler]:
    """The shipped model for a map of DATA/robots, with the networks of its fold alone.

    The shipped networks are one of each fold, and then further ones in the same order.
    """
    labeler, maps, shipped = trained_labeler(), declared(), trained_floor().networks
    alone = [with_networks(labeler, shipped[fold::N_FOLDS]) for fold in range(N_FOLDS)]
    return lambda name: alone[maps[name].fold]


def measure(data: Path, kept: Path, progress: Progress, *, continued: bool = False) -> None:
    """Print the figures of robots' maps by kind, each with the networks of its fold."""
    labeler, declaration = trained_labeler(), declared()
    labelers = [with_networks(labeler, fold) for fold in networks(kept, continued=continued)]
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


def ship(kept: Path, *, continued: bool = False) -> None:
    """Write the model ``default`` with all networks; its record says how they were trained."""
    stored = stored_labeler(DEFAULT)
    folds = networks(kept, continued=continued)
    ordered = [network for generation in zip(*folds, strict=True) for network in generation]
    record = {**stored.record, "floor": {"command": "python -m experiments.floor_network"}}
    with np.load(network_file(kept, 0), allow_pickle=False) as file:
        record["floor"]["steps"] = int(file["steps"])
    if continued:
        earlier = stored.record["floor"]
        record["floor"]["continued"] = earlier.get("continued", earlier)  # also if shipped again
    save(with_networks(stored.item, ordered, _VIEWS), model_folder(DEFAULT), record=record)
