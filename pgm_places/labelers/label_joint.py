"""Labelling a map together with a drive, at any resolution of the map."""

from typing import NamedTuple

from pgm_places.inference.backends import METHODS
from pgm_places.inference.labeling import Labeling
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.labelled_places import LabelledPlaces, at_model_resolution, on_own_raster
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Progress, reporting_to, warn
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.trajectories.trajectory import Trajectory


class LabelledDrive(NamedTuple):
    """A labelled map and the labelling of a drive through it.

    Parameters
    ----------
    map : LabelledPlaces
        The labelled map, at its original resolution.
    steps : Labeling
        Labels of the drive's steps.
    """

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
    :func:`~pgm_places.labelling.label.label_map`.

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
        The map has no free cell, also at the model's resolution, or would have to be refined to too
        many cells.
    InputError
        None of the drive's positions is on a free cell of the map.
    NotFittedError
        The labeler is not fitted.
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
