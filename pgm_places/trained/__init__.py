"""The models that ship with the package: learned numbers and their provenance, no data."""

from pathlib import Path
from typing import TYPE_CHECKING

from pgm_places._checks import nearest_name
from pgm_places.errors import ModelFileError

if TYPE_CHECKING:
    from pgm_places.labelers.place_labeler import PlaceLabeler

__all__ = ["DEFAULT", "NAMES", "model_folder", "trained_labeler"]

NAMES = ("default", "generated")
"""``default`` was trained on real and generated office buildings, ``generated`` on generated ones
alone; both distinguish corridor, room and doorway on 5 cm cells."""

DEFAULT = NAMES[0]


def model_folder(name: str | Path) -> Path:
    """The folder of a shipped model by its name, else the given folder.

    A name of a shipped model is always that: whatever the current folder holds does not stand in
    for it. A folder of that name is ``./default``.

    Raises
    ------
    ModelFileError
        Neither a folder nor a shipped model.
    """
    if name in NAMES:
        return Path(__file__).parent / str(name)
    if Path(name).exists():
        return Path(name)
    raise ModelFileError(
        f"no model at {name}, and none of that name ships with the package. "
        f"{nearest_name(str(name), list(NAMES))}"
    )


def trained_labeler(name: str | Path = DEFAULT) -> "PlaceLabeler":
    """A labeler that needs no training, by name or from a folder.

    Examples
    --------
    >>> labeler = trained_labeler()
    >>> labeler.label_names_
    ('corridor', 'room', 'doorway')
    """
    from pgm_places.persistence.stored import read

    found: PlaceLabeler = read(model_folder(name), "place-labeler").item
    return found
