"""The choices of labelling: the model with its overrides, and the files to write."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from pgm_places.errors import InputError, nearest_name
from pgm_places.options import Positive, UnknownGrey, Whole
from pgm_places.trained import DEFAULT, model_folder

_NONE = "none"


@dataclass(frozen=True)
class Outputs:
    """The files that may be left out.

    Parameters
    ----------
    pictures : bool
        ``overview.png``, ``topology.png`` and, in a batch, ``thumbnail.png``: for people.
    probabilities : bool
        ``probability_<label>.png``.
    """

    pictures: bool = True
    probabilities: bool = True

    @classmethod
    def named(cls, text: str) -> Self:
        """Those that a list with commas names; ``none`` names none.

        Raises
        ------
        InputError
            There is no such kind of file.

        Examples
        --------
        >>> Outputs.named("pictures"), Outputs.named("none").probabilities
        (Outputs(pictures=True, probabilities=False), False)
        """
        names = [name.strip() for name in text.split(",")]
        known = [*cls.__dataclass_fields__, _NONE]
        for name in names:
            if name not in known or (name == _NONE and len(names) > 1):
                raise InputError(
                    f"--outputs takes pictures, probabilities, both with a comma between, or none; "
                    f"got {text!r}. {nearest_name(name, known)}"
                )
        return cls(**{name: name in names for name in cls.__dataclass_fields__})


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """A stored model, and options that replace its own.

    Parameters
    ----------
    model : str
        A folder, or the name of a model that ships with the package.
    method : str
        One of the model's methods; its last one by default.
    doorways : gates|labels
        What separates places: gates, if the model finds any, or cells labelled as doorways; by
        default, as set in the model's [topology].
    halls : corridor|room|hall
        What lobbies, foyers and other halls are labelled, if the model knows them; by default, as
        set in the model's [labels].
    doorway_depth_m : M
        How deep doorways are labelled along the passage; by default, as in the maps that the model
        learned from (m).
    disc_radius_m : float
    unentered : bool
        As of :class:`~pgm_places.spaces.entered_options.EnteredOptions`; by default, as set in the
        model's [entered].
    """

    model: str = DEFAULT
    method: str | None = None
    doorways: str | None = None
    halls: str | None = None
    doorway_depth_m: Positive | None = None
    disc_radius_m: float | None = None
    unentered: bool | None = None

    @property
    def folder(self) -> Path:
        """The model's folder."""
        return model_folder(self.model)


@dataclass(frozen=True, kw_only=True)
class LabelOptions(ModelOptions):
    """The choices of ``pgm-places label``, apart from the maps.

    Parameters
    ----------
    unknown_value
        Grey value of maps that is read as unknown, as for
        :func:`~pgm_places.io.maps.map_server.load_map`.
    max_cells
        Largest number of cells that a map coarser than the model is split into; 100 million by
        default.
    outputs : Outputs
        The files to write besides labels and places.
    """

    unknown_value: UnknownGrey | None = None
    max_cells: Whole | None = None
    outputs: Outputs = field(default_factory=Outputs)
