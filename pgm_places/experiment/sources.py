"""Loading the training and test data of an experiment."""

from collections.abc import Sequence
from typing import NamedTuple

from pgm_places.experiment.drives import SourceDrive, load_drives
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import SourceGraph, load_graphs
from pgm_places.experiment.maps import load_maps
from pgm_places.maps.labelled_map import LabelledMap

Source = LabelledMap | SourceDrive | SourceGraph


class Sources(NamedTuple):
    """Maps and drives to train or to test on.

    Parameters
    ----------
    maps : sequence of LabelledMap
    drives : sequence of SourceDrive
    graphs : sequence of SourceGraph
        User-defined graphs; maps and drives are then empty.
    """

    maps: Sequence[LabelledMap] = ()
    drives: Sequence[SourceDrive] = ()
    graphs: Sequence[SourceGraph] = ()

    @property
    def all(self) -> list[Source]:
        """Maps, then drives, then graphs."""
        return [*self.maps, *self.drives, *self.graphs]


def load_sources(experiment: Experiment, part: str, like: Sources | None = None) -> Sources:
    """The sources of ``"train"`` or ``"test"``; graphs must have the features of ``like``.

    Raises
    ------
    LogError, MapError, LabelError, InputError
        A file cannot be read, or has no true label.
    """
    if experiment.config.nodes == "graph":
        return Sources(graphs=load_graphs(experiment, part, () if like is None else like.graphs))
    maps = load_maps(experiment, part)
    if experiment.config.nodes == "cells":
        return Sources(maps)
    return Sources(maps, load_drives(experiment, part))
