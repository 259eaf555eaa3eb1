"""Reading a labelled map as a prior of positions."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pgm_places.errors import LabelError
from pgm_places.io.input_file import user_path
from pgm_places.io.places.result_folder import detail_path, probability_file
from pgm_places.io.places.topology_files import load_topology, read_shares
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.topology.topological_map import TopologicalMap


class LabelledMapFolder(NamedTuple):
    """A labelled map, read from its folder: label probabilities and places at positions."""

    prior: MapPrior
    places: TopologicalMap


def read_labelled_map(folder: Path | str, label_names: Sequence[str]) -> LabelledMapFolder:
    """The labels, probabilities and places in a folder written by ``pgm-places label``.

    Without probabilities, the labels of the places are used. ``label_names`` (K) is the order of
    beliefs; a map with other labels is a LabelError.
    """
    place = user_path(folder, LabelError)
    places = load_topology(place)
    if set(places.label_names) != set(label_names):
        raise LabelError(
            f"{place} has the labels {', '.join(places.label_names)}, but the model has "
            f"{', '.join(label_names)}; label the map with labels of the same names"
        )
    files = [detail_path(place, probability_file(name)) for name in label_names]
    if all(file.is_file() for file in files):
        shares = [read_shares(file, places.grid.shape, LabelError) for file in files]
        table = np.stack(shares, axis=2).astype(np.float32) / np.float32(255.0)
        return LabelledMapFolder(MapPrior(places.grid, table), places)
    number = np.array([list(label_names).index(name) for name in places.label_names] + [-1])
    prior = MapPrior.of_labels(places.grid, number[places.labels], len(label_names))
    return LabelledMapFolder(prior, places)
