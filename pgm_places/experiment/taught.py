"""Training a model further: it is taught each training map in turn, as in the studio."""

from collections.abc import Sequence

import numpy as np

from pgm_places.experiment.config import NO_MODEL
from pgm_places.experiment.experiment import Experiment
from pgm_places.io.input_file import sha256_of
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.persistence.model_folder import MANIFEST
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.teacher import Teacher
from pgm_places.trained import NAMES, model_folder, trained_labeler

__all__ = ["taught_labeler"]


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
            teacher = Teacher(
                item.grid,
                labeler,
                classes=config.labels.names,
                options=config.teaching,
                n_threads=experiment.n_threads,
            )
            labels = item.labels
            if item.window is not None:
                labels = np.where(item.window, labels, np.int16(-1))
            paint = Paint(labels, config.labels.names)
            labeler = teacher.learned(paint, experiment.progress)
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
