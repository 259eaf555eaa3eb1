"""Floor networks in a model's folder, or those that ship with the package by name."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ModelFileError
from pgm_places.floor.network import FloorNetwork
from pgm_places.persistence.model_folder import Arrays, load_folder
from pgm_places.unary.floor_model import FloorModel

__all__ = ["dump_floor", "dump_shared_floor", "load_floor"]

_OPTIONS = ("views_per_network", "share", "doorway_share", "gate_share")

_SHIPPED = Path(__file__).resolve().parents[1] / "trained" / "default"
"""The model whose networks others share."""


def dump_floor(arrays: Arrays, floor: FloorModel) -> dict[str, Any]:
    """The record of some networks; they themselves go into the arrays."""
    for number, network in enumerate(floor.networks):
        arrays[f"floor/{number}"] = network.packed()
    return {"n_networks": len(floor.networks), **_options(floor)}


def dump_shared_floor(arrays: Arrays, floor: FloorModel) -> dict[str, Any]:
    """The same, but those of the shipped model are only named: they would be half of the folder."""
    shipped = [network.packed() for network in _shipped_networks()]
    mine = [network.packed() for network in floor.networks]
    if len(mine) == len(shipped) and all(map(_equal, mine, shipped)):
        return {"networks_of": _SHIPPED.name, **_options(floor)}
    return dump_floor(arrays, floor)


def load_floor(
    record: Mapping[str, Any] | None, arrays: Arrays, n_labels: int
) -> FloorModel | None:
    """The networks of a record, if there is one.

    Raises
    ------
    ModelFileError
        The columns do not fit the labels, or the networks are those of an unknown model.
    """
    if record is None:
        return None
    columns = tuple(record["columns"])
    if len(columns) != n_labels:
        raise ModelFileError(f"floor.columns must have {n_labels} entries, got {len(columns)}")
    if "networks_of" in record:
        if record["networks_of"] != _SHIPPED.name:
            raise ModelFileError(
                f"floor.networks_of must be {_SHIPPED.name!r}, got {record['networks_of']!r}"
            )
        networks = _shipped_networks()
    else:
        networks = _networks(arrays, record["n_networks"])
    return FloorModel(networks, columns, **{name: record[name] for name in _OPTIONS})


def _options(floor: FloorModel) -> dict[str, Any]:
    options = {name: getattr(floor, name) for name in _OPTIONS}
    return {"columns": list(floor.columns), **options}


def _networks(arrays: Arrays, n: int) -> tuple[FloorNetwork, ...]:
    return tuple(FloorNetwork.unpacked(arrays[f"floor/{k}"]) for k in range(n))


def _shipped_networks() -> tuple[FloorNetwork, ...]:
    manifest, arrays = load_folder(_SHIPPED)
    return _networks(arrays, manifest["floor"]["n_networks"])


def _equal(a: NDArray[Any], b: NDArray[Any]) -> bool:
    return bool(np.array_equal(a, b))
