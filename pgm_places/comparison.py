"""Several methods on the same maps: what a comparison holds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.evaluation import Evaluation
from pgm_places.grid import OccupancyGrid
from pgm_places.labeling import Labeling
from pgm_places.layout import GridLayout

__all__ = ["Comparison", "MethodResult", "TestMap"]


@dataclass(frozen=True, eq=False)
class TestMap:
    """A map that was labelled, with its ground truth.

    Parameters
    ----------
    name : str
        What to call it in tables.
    grid : OccupancyGrid
        The map that the scans were taken in.
    truth : (H, W) int16
        True label index per cell, -1 where it is not known.
    layout : GridLayout
        The cells that were labelled: the free cells inside the window.
    window : (H, W) bool
        The part of the map that was tested.
    """

    name: str
    grid: OccupancyGrid
    truth: NDArray[np.int16]
    layout: GridLayout
    window: NDArray[np.bool_]

    __test__ = False  # not a test class, whatever pytest thinks of its name


@dataclass(frozen=True, eq=False)
class MethodResult:
    """One method's answers: a labelling and an evaluation per map, and the pooled evaluation."""

    id: str
    name: str
    options: Mapping[str, Any]
    labelings: tuple[Labeling, ...]
    evaluations: tuple[Evaluation, ...]
    evaluation: Evaluation
    seconds: Mapping[str, float]
    learned: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything a comparison found, ready for the table, the pictures and the report."""

    title: str
    label_names: tuple[str, ...]
    maps: tuple[TestMap, ...]
    methods: tuple[MethodResult, ...]
    stage_seconds: Mapping[str, float]
    config: Mapping[str, Any]
    versions: Mapping[str, str]
    inputs: Mapping[str, str]
    warnings: tuple[str, ...] = ()
