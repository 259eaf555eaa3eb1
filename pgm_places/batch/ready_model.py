"""How maps are to be labelled: the model, read, with what departs from its options."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pgm_places.io.input_file import sha256_of
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.options import UnknownGrey, from_mapping, option_values
from pgm_places.persistence.model_folder import MANIFEST
from pgm_places.persistence.stored import read
from pgm_places.report.label_files import Outputs
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.topology.rules import TopologyOptions
from pgm_places.trained import model_folder


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """The choices of ``pgm-places label``, apart from the maps.

    Parameters
    ----------
    model : str
        A folder, or the name of a model that ships with the package.
    method : str, optional
        One of the model's; its last one by default.
    doorways, halls : str, optional
        Instead of what the model's tables ``[topology]`` and ``[labels]`` say.
    doorway_depth_m : float, optional
        Instead of what the model's table ``[labels]`` says.
    disc_radius_m : float, optional
    unentered : bool, optional
        Instead of what the model's table ``[entered]`` says:
        :class:`~pgm_places.spaces.entered_options.EnteredOptions`.
    unknown_value : int or "none", optional
        Grey value of maps that is read as unknown, as for
        :func:`~pgm_places.io.maps.map_server.load_map`.
    max_cells : int, optional
        No map is refined to more cells than this; 100 million by default.
    outputs : Outputs
        Which files are written besides labels and places.
    """

    model: str = "default"
    method: str | None = None
    doorways: str | None = None
    halls: str | None = None
    doorway_depth_m: float | None = None
    disc_radius_m: float | None = None
    unentered: bool | None = None
    unknown_value: UnknownGrey | None = None
    max_cells: int | None = None
    outputs: Outputs = field(default_factory=Outputs)

    @property
    def folder(self) -> Path:
        """The model's folder."""
        return model_folder(self.model)


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class ReadyModel:
    """A model that has been read, with the options applied.

    Parameters
    ----------
    labeler : PlaceLabeler
    rules : TopologyOptions
        Of the topological maps.
    entered : EnteredOptions
        What of a map counts as entered.
    method : str
        What labels the maps.
    sha256 : str
        Of the model's manifest, which holds that of its arrays.
    """

    labeler: PlaceLabeler
    rules: TopologyOptions
    entered: EnteredOptions
    method: str
    sha256: str

    @property
    def chosen(self) -> PlaceMethod:
        """The method, with the scores that it starts from."""
        return self.labeler.method(self.method)


def ready_model(options: LabelOptions) -> ReadyModel:
    """The model that the options name, with the others applied.

    Raises
    ------
    ModelFileError
        There is no such model, or it is damaged.
    ConfigError
        The model has no such method, or an option does not take its value.
    """
    stored = read(options.folder, "place-labeler", "joint-labeler")
    labeler, rules = stored.item, with_given(stored.rules, {"doorways": options.doorways})
    if stored.kind == "joint-labeler":
        labeler = labeler.of_maps()
    given = {name: getattr(options, name) for name in ("halls", "doorway_depth_m")}
    given = {name: value for name, value in given.items() if value is not None}
    if given:
        labeler = labeler.with_options(**given)
    method = options.method or labeler.default_method
    labeler.method(method)  # an unknown one shows now
    of_entered = {name: getattr(options, name) for name in option_values(stored.entered)}
    entered = with_given(stored.entered, of_entered)
    return ReadyModel(labeler, rules, entered, method, sha256_of(options.folder / MANIFEST))


def with_given(options: T, given: Mapping[str, Any]) -> T:
    """A model's options with others in their place, where these were given (are not None)."""
    changed = {name: value for name, value in given.items() if value is not None}
    return from_mapping(type(options), {**option_values(options), **changed})
