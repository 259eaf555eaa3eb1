"""LoadedModel: a stored labeler with its rules, and with overrides applied."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self, TypeVar

from pgm_places.io.input_file import sha256_of
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelling.options import ModelOptions
from pgm_places.options import from_mapping, option_values
from pgm_places.persistence.model_folder import MANIFEST
from pgm_places.persistence.stored import read
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.topology.rules import TopologyOptions

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class LoadedModel:
    """A fitted labeler, its method (by default the labeler's) and its rules, ready to label maps.

    ``sha256`` is the hash of the model's manifest; empty without a folder. NotFittedError if the
    labeler is not fitted, ConfigError if it has no such method.
    """

    labeler: PlaceLabeler
    method: str = ""
    rules: TopologyOptions = field(default_factory=TopologyOptions)
    entered: EnteredOptions = field(default_factory=EnteredOptions)
    sha256: str = ""

    def __post_init__(self) -> None:
        self.labeler.check_fitted()
        if not self.method:
            object.__setattr__(self, "method", self.labeler.default_method)
        self.labeler.method(self.method)  # raises for an unknown method

    @classmethod
    def of(cls, model: "LoadedModel | PlaceLabeler") -> "LoadedModel":
        """A model, or a labeler with default rules as a model."""
        return model if isinstance(model, LoadedModel) else cls(model)

    @classmethod
    def load(cls, options: ModelOptions | None = None) -> Self:
        """Load the model of the options and apply their overrides.

        ModelFileError for a missing or damaged model; ConfigError for an unknown method or invalid
        option.

        Examples
        --------
        >>> model = LoadedModel.load(ModelOptions(model="generated", unentered=True))
        >>> model.method, model.rules.min_width_m, model.entered.unentered
        ('potts', 0.3, True)
        """
        options = options or ModelOptions()
        stored = read(options.folder, "place-labeler", "joint-labeler")
        labeler: PlaceLabeler = stored.item
        if stored.kind == "joint-labeler":
            labeler = stored.item.of_maps()
        labels = _given(halls=options.halls, doorway_depth_m=options.doorway_depth_m)
        if labels:
            labeler = labeler.with_options(**labels)
        entered = with_given(
            stored.entered,
            {"disc_radius_m": options.disc_radius_m, "unentered": options.unentered},
        )
        rules = with_given(stored.rules, {"doorways": options.doorways})
        if not entered.unentered:  # places have to be wide enough for the robot
            least = max(rules.min_clearance_m, entered.disc_radius_m)
            rules = with_given(rules, {"min_clearance_m": least})
        return cls(
            labeler, options.method or "", rules, entered, sha256_of(options.folder / MANIFEST)
        )

    @property
    def chosen(self) -> PlaceMethod:
        """The method with its unary."""
        return self.labeler.method(self.method)


def _given(**values: object) -> dict[str, object]:
    """The values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def with_given(options: T, given: Mapping[str, object]) -> T:
    """A model's options, replaced by the given ones that are not None."""
    return from_mapping(type(options), {**option_values(options), **_given(**given)})
