"""The models that ship with the package: learned numbers and their provenance, no data."""

from pathlib import Path
from typing import TYPE_CHECKING

from pgm_places._arguments import public
from pgm_places.errors import ModelFileError, nearest_name

if TYPE_CHECKING:
    from pgm_places.labelers.place_labeler import PlaceLabeler
    from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
    from pgm_places.persistence.stored import Stored
    from pgm_places.unary.floor_model import FloorModel

__all__ = [
    "DEFAULT",
    "NAMES",
    "TRACKING",
    "model_folder",
    "stored_labeler",
    "trained_floor",
    "trained_labeler",
    "trained_tracker",
]

NAMES = ("default", "generated")
"""``default`` was trained on real and generated office buildings, ``generated`` on generated ones
alone; both distinguish corridor, room and doorway on 5 cm cells."""

DEFAULT = NAMES[0]

TRACKING = "tracking"
"""Labels drives without a map: it was trained on drives simulated in the buildings of ``default``,
with lasers of every kind."""


def model_folder(name: str | Path) -> Path:
    """The folder of a shipped model by its name, else the given folder.

    The name of a shipped model takes precedence over a folder of this name: write ``./default``
    for the folder.

    Raises
    ------
    ModelFileError
        Neither a folder nor a shipped model.
    """
    if name in (*NAMES, TRACKING):
        return Path(__file__).parent / str(name)
    if Path(name).exists():
        return Path(name)
    raise ModelFileError(
        f"no model at {name}, and none of that name ships with the package. "
        f"{nearest_name(str(name), [*NAMES, TRACKING])}"
    )


@public
def trained_labeler(name: str | Path = DEFAULT) -> "PlaceLabeler":
    """A labeler that needs no training, by name or from a folder.

    Examples
    --------
    >>> labeler = trained_labeler()
    >>> labeler.label_names_
    ('corridor', 'room', 'doorway')
    """
    found: PlaceLabeler = stored_labeler(name).item
    return found


def stored_labeler(name: str | Path = DEFAULT) -> "Stored":
    """Such a labeler with its record and its rules of places."""
    from pgm_places.persistence.stored import read

    return read(model_folder(name), "place-labeler")


def trained_floor() -> "FloorModel":
    """The floor networks of the model ``default``.

    Examples
    --------
    >>> len(trained_floor().networks)
    8
    """
    floor: FloorModel | None = trained_labeler(DEFAULT).unary_model_.floor
    assert floor is not None  # the package ships them
    return floor


@public
def trained_tracker(name: str | Path = TRACKING) -> "TrajectoryLabeler":
    """A labeler of drives that needs no training and no map, by name or from a folder.

    Examples
    --------
    >>> tracker = trained_tracker()
    >>> tracker.label_names_, tracker.every_m
    (('corridor', 'room', 'doorway'), 0.25)
    """
    from pgm_places.persistence.stored import read

    found: TrajectoryLabeler = read(model_folder(name), "trajectory-labeler").item
    return found
