"""A model that is ready to label: read, with the options applied."""

from dataclasses import dataclass
from typing import Any

from pgm_places.batch.label_options import LabelOptions
from pgm_places.io.checks import sha256_of
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.options import from_mapping, option_values
from pgm_places.persistence.model_folder import MANIFEST
from pgm_places.persistence.stored import read
from pgm_places.topology.rules import TopologyOptions

__all__ = ["ReadyModel", "ready_model", "rules_with"]


@dataclass(frozen=True, eq=False)
class ReadyModel:
    """A model that has been read, with the options applied.

    Parameters
    ----------
    labeler : PlaceLabeler
    rules : TopologyOptions
        Of the topological maps.
    method : str
        What labels the maps.
    sha256 : str
        Of the model's manifest, which holds that of its arrays.
    """

    labeler: PlaceLabeler
    rules: TopologyOptions
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
    labeler, rules = stored.item, rules_with(stored.rules, options.doorways)
    if stored.kind == "joint-labeler":
        labeler = labeler.of_maps()
    if options.halls is not None:
        labeler = labeler.with_options(halls=options.halls)
    method = options.method or labeler.default_method
    labeler.method(method)  # an unknown one shows now
    return ReadyModel(labeler, rules, method, sha256_of(options.folder / MANIFEST))


def rules_with(rules: TopologyOptions, doorways: str | None) -> TopologyOptions:
    """A model's rules with what the option says separates places, if it was given."""
    if doorways is None:
        return rules
    changed: dict[str, Any] = {**option_values(rules), "doorways": doorways}
    return from_mapping(TopologyOptions, changed)
