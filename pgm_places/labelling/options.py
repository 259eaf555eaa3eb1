"""Options of labelling: the model, its overrides, and the output files."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from pgm_places.errors import InputError, nearest_name
from pgm_places.options import Positive, UnknownGrey, Whole
from pgm_places.trained import DEFAULT, model_folder

_NONE = "none"


@dataclass(frozen=True)
class Outputs:
    """Optional output files.

    Parameters
    ----------
    pictures : bool
        ``overview.png``, ``topology.png`` and, in a batch, ``thumbnail.png``.
    probabilities : bool
        ``probability_<label>.png``.
    """

    pictures: bool = True
    probabilities: bool = True

    @classmethod
    def named(cls, text: str) -> Self:
        """Parse a list separated by commas, or ``none``; InputError for an unknown name.

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
                    "--outputs must be pictures, probabilities, both separated by a comma, or "
                    f"none; got {text!r}. {nearest_name(name, known)}"
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
        Label of lobbies, foyers and other halls, if the model distinguishes them; by default, as
        set in the model's [labels].
    doorway_depth_m : M
        Depth of doorways along the passage (m); by default, as in the model's training maps.
    disc_radius_m : float
    unentered : bool
        See :class:`~pgm_places.spaces.entered_options.EnteredOptions`; by default, as set in the
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
    """Options of ``pgm-places label``.

    Parameters
    ----------
    unknown_value
        Grey value of unknown cells: see :func:`~pgm_places.io.maps.map_server.load_map`.
    max_cells
        Most cells after refining a map that is coarser than the model; 100 million by default.
    outputs : Outputs
        The files to write besides labels and places.
    """

    unknown_value: UnknownGrey | None = None
    max_cells: Whole | None = None
    outputs: Outputs = field(default_factory=Outputs)
