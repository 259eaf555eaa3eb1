"""A fitted JointLabeler as plain data: its two labelers and its method."""

from collections.abc import Mapping
from typing import Any

from pgm_places.errors import ModelFileError
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.method import unfitted
from pgm_places.options import Positive, check_option
from pgm_places.persistence import place_labeler, trajectory_labeler
from pgm_places.persistence.backend import dump_backend, load_backend
from pgm_places.persistence.model_folder import Arrays, below, put_below

CODECS = {"places": place_labeler, "steps": trajectory_labeler}


def dump(labeler: JointLabeler) -> tuple[dict[str, Any], Arrays]:
    """The manifest and the arrays of a fitted labeler."""
    arrays: Arrays = {}
    manifest: dict[str, Any] = {
        "label_names": list(labeler.label_names_),
        "options": {"link_weight": labeler.link_weight},
        "link_weight": labeler.link_weight_,
        "method": dump_backend(arrays, "method", labeler.method_),
    }
    for name, codec in CODECS.items():
        manifest[name], inner = codec.dump(getattr(labeler, f"{name}_"))
        put_below(arrays, name, inner)
    return manifest, arrays


def load(manifest: Mapping[str, Any], arrays: Arrays) -> JointLabeler:
    """The labeler of :func:`dump`."""
    names = tuple(str(name) for name in manifest["label_names"])
    method = load_backend(arrays, "method", manifest["method"])
    labelers = {
        name: codec.load(manifest[name], below(arrays, name)) for name, codec in CODECS.items()
    }
    for name, inner in labelers.items():
        if inner.label_names_ != names:
            raise ModelFileError(f"{name} has labels {list(inner.label_names_)}, not {list(names)}")
    labeler = JointLabeler(names, unfitted(method), **manifest["options"])
    labeler.check_options()
    weight = check_option("link_weight", Positive | None, manifest["link_weight"])
    return labeler.set_learned(
        places_=labelers["places"],
        steps_=labelers["steps"],
        method_=method,
        link_weight_=weight,
        label_names_=names,
    )
