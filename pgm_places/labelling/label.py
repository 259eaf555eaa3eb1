"""Labelling a map, or a map and a drive through it, at the map's original resolution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.backends import METHODS, Backend
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.kernels.lazy_memory import trim_heap
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.labelled_places import (
    LabelledPlaces,
    at_model_resolution,
    on_own_raster,
    window_to_label,
)
from pgm_places.labelers.method import infer
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.place_problem import accepted_doorways
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.places import doorways_as_rectangles, separating_gates
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import Whole
from pgm_places.progress import Progress, report_stage, reporting_to, warn
from pgm_places.spaces.doorways import DECISIVE_SHARE, Doorways, partly_covered
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.feature_table import CachedFeatures
from pgm_places.unary.map_model import CellScores

FeaturesOf = Callable[[OccupancyGrid], CachedFeatures | None]
"""Cached laser features of a map at the model's resolution, or None."""


@public
def label_map(
    labeler: PlaceLabeler,
    grid: OccupancyGrid,
    *,
    method: str | None = None,
    known: ArrayLike | None = None,
    entered: EnteredOptions | None = None,
    features_of: FeaturesOf | None = None,
    max_cells: Whole | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> LabelledPlaces:
    """Label a map with a fitted labeler; labels have the map's original resolution.

    Weights of a model are valid at one resolution. A map that is finer is coarsened for labelling,
    and its labels are written at the original resolution. A map that is coarser is refined, and
    each cell gets the most frequent label of its parts. A warning reports the resampling.

    Parameters
    ----------
    labeler : PlaceLabeler
    grid : OccupancyGrid
    method : str, optional
        The labeler's default method if not given.
    known : (H, W) int, optional
        Observed labels: index into ``labeler.label_names_``, -1 elsewhere. They are fixed, and
        influence the labels of other cells. Gates follow them: a gate observed as doorway, or as
        another label, is accepted or rejected.
    entered : EnteredOptions, optional
        Unreachable space gets no label, unless the options request it or the label is observed.
        Labels of other cells do not depend on this.
    features_of : callable, optional
        Returns cached laser features of the map at the model's resolution, or None.
    max_cells : int, optional
        Most cells of a refined map; 100 million by default.
    n_threads, progress
        See :mod:`pgm_places.labelers.labeler`.

    Raises
    ------
    MapError
        The map has no free cell, also at the model's resolution, or would have to be refined to too
        many cells.
    LabelError
        Observed labels do not fit the map or the label names.
    """
    return label(
        LoadedModel(labeler, method or "", entered=entered or EnteredOptions()),
        grid,
        observed=known,
        cache=features_of,
        max_cells=max_cells,
        n_threads=n_threads,
        progress=progress,
    )


def label(
    model: LoadedModel,
    grid: OccupancyGrid,
    *,
    observed: ArrayLike | None = None,
    cache: FeaturesOf | None = None,
    max_cells: Whole | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> LabelledPlaces:
    """:func:`label_map` with a model's method and rules."""
    window = window_to_label(grid, model.labeler.resolution_m_)
    if window is not None:
        part = label(
            model,
            window.crop(grid),
            observed=None if observed is None else window.cut(np.asarray(observed)),
            cache=cache,
            max_cells=max_cells,
            n_threads=n_threads,
            progress=progress,
        )
        return part.on_whole(grid, window)
    with thread_limit(n_threads), reporting_to(progress):
        return score_map(model, grid, observed, cache, max_cells=max_cells).labelled()


@dataclass(frozen=True, eq=False)
class ScoredMap:
    """A map at the resolution of a model (``used``), and its labelling problem.

    ``hall`` (N,) is the probability that a node in circulation space (corridor or hall) is in a
    hall. ``scores``, of the cells and their graph, are for other methods; they are not stored for
    huge maps.
    """

    model: LoadedModel
    grid: OccupancyGrid
    used: OccupancyGrid
    observed: KnownCells | None
    warnings: tuple[str, ...]
    doorways: Doorways | None
    layout: GridLayout
    problem: LabelingProblem
    hall: NDArray[np.float32] | None
    scores: tuple[LabelGraph, CellScores] | None = None

    def by(self, method: str) -> ScoredMap:
        """The problem of another method, from the cached scores."""
        assert self.scores is not None  # because of keep_scores
        model = replace(self.model, method=method)
        return replace(self, model=model, problem=_problem(model, *self.scores, self.observed))

    def labelled(self, independent: Backend | None = None) -> LabelledPlaces:
        """The map labelled by the method, or cell by cell; observed labels stay fixed."""
        model, observed = self.model, self.observed
        name = model.method if independent is None else "independent"
        trim_heap()  # frees the memory of scoring
        with report_stage(f"labelling with {name}"):
            labeling = infer(independent or model.chosen.backend, self.problem)
            labeling = model.labeler.with_halls(labeling, self.hall)
        if observed is not None:
            labeling = observed.enforced(labeling, self.layout)
        hall = model.labeler.hall_probability(labeling, self.hall)
        return on_own_raster(
            self.grid,
            self.used,
            self.layout,
            self._with_rectangles(labeling),
            label_names=model.labeler.label_names_,
            method=name,
            warnings=self.warnings,
            doorways=self.doorways,
            known=observed,
            entered=model.entered,
            hall=hall,
        )

    def _with_rectangles(self, labeling: Labeling) -> Labeling:
        """The labels with a rectangle of doorway at each gate that separates places."""
        rules, names = self.model.rules, self.model.labeler.label_names_
        gates = separating_gates(self.doorways, rules)
        if gates is None or rules.doorway_label not in names:
            return labeling
        labels = doorways_as_rectangles(
            self.layout.to_raster(labeling.labels.astype(np.int16), fill=-1),
            self.used,
            gates,
            names.index(rules.doorway_label),
            depth_m=self.model.labeler.doorway_depth_m,
            fixed=None if self.observed is None else self.observed.on_cells >= 0,
        )
        return replace(
            labeling, labels=self.layout.from_raster(labels).astype(labeling.labels.dtype)
        )


def score_map(
    model: LoadedModel,
    grid: OccupancyGrid,
    observed: ArrayLike | None = None,
    cache: FeaturesOf | None = None,
    *,
    max_cells: int | None = None,
    keep_scores: bool = False,
) -> ScoredMap:
    """Score the cells of a map for the model's method; the arguments are those of :func:`label`.

    ``keep_scores`` stores the scores with segments, gates and places, for other methods and
    explanations.
    """
    labeler = model.labeler
    used, warnings = at_model_resolution(labeler, grid, max_cells=max_cells)
    for message in warnings:
        warn(message)
    cells = None
    names = labeler.label_names_
    if observed is not None:
        cells = KnownCells.of(observed, grid, used, names, labeler.learned_names)
    raster = None if cells is None else cells.on_cells
    graph, scores = labeler.scores(
        used,
        methods=[model.method],
        lean=True,
        with_spaces=keep_scores,
        known=raster,
        own=None if cache is None else cache(used),
    )
    doorways = accepted_doorways(labeler.unary_model_, used, scores, raster)
    if doorways is not None and raster is not None and model.rules.doorway_label in names:
        doorway = names.index(model.rules.doorway_label)
        for message in _covered_too_little(doorways, raster, doorway):
            warn(message)
            warnings.append(message)
    return ScoredMap(
        model,
        grid,
        used,
        cells,
        tuple(warnings),
        doorways,
        graph.grid_layout,
        _problem(model, graph, scores, cells),
        scores.hall,
        (graph, scores) if keep_scores else None,
    )


def _covered_too_little(
    doorways: Doorways, observed: NDArray[np.integer], doorway: int
) -> Iterator[str]:
    """A line for each doorway that corrections cover in part and do not remove."""
    for gate, share in partly_covered(doorways, observed, doorway):
        x, y = gate.centre_m
        yield (
            f"the corrections cover only {100 * share:.0f} % of the doorway at ({x:.2f}, {y:.2f}), "
            f"so it stays; paint at least {100 * DECISIVE_SHARE:.0f} % of it, from wall to wall, "
            "to remove it"
        )


def _problem(
    model: LoadedModel, graph: LabelGraph, scores: CellScores, observed: KnownCells | None
) -> LabelingProblem:
    known = None if observed is None else observed.of_nodes(graph.grid_layout)
    return model.labeler.problem_of(graph, scores, model.chosen, known=known)


class LabelledDrive(NamedTuple):
    """A map with labels at its original resolution, and the labels of a drive's steps."""

    map: LabelledPlaces
    steps: Labeling


def label_map_and_drive(
    labeler: JointLabeler,
    grid: OccupancyGrid,
    drive: Trajectory,
    *,
    entered: EnteredOptions | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> LabelledDrive:
    """Label a map and a drive as one graph; the map's labels have its original resolution.

    A map of another resolution than the training maps is resampled first, with a warning, as by
    :func:`label_map`.

    Parameters
    ----------
    labeler : JointLabeler
        Fitted.
    grid : OccupancyGrid
        In the frame of the drive's poses.
    drive : Trajectory
        With scans, or without them if the model casts them in the map.
    entered : EnteredOptions, optional
        Options of unreachable space, which gets no label.
    n_threads, progress
        See :mod:`pgm_places.labelers.labeler`.

    Raises
    ------
    MapError
        As for :func:`label_map`.
    InputError
        None of the drive's positions is on a free cell of the map.
    """
    labeler.check_fitted()
    with thread_limit(n_threads), reporting_to(progress):
        used, warnings = at_model_resolution(labeler.places_, grid)
        for message in warnings:
            warn(message)
        scores = labeler.scores(used, drive)
        labeling = labeler.infer(scores)
    cells, steps = labeling.cells, labeling.steps
    assert cells is not None and steps is not None and scores.graph.cells is not None
    places = on_own_raster(
        grid,
        used,
        scores.graph.cells.grid_layout,
        cells,
        label_names=labeler.label_names_,
        method=METHODS.name_of(type(labeler.method_)),
        warnings=warnings,
        doorways=scores.doorways,
        entered=entered or EnteredOptions(),
    )
    return LabelledDrive(places, steps)
