"""The features of gates, one row per gate."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import distances_to_others
from pgm_places.spaces.gates import Gates
from pgm_places.spaces.segment_features import segment_features
from pgm_places.spaces.space_spec import GATE_FEATURES, GATE_SHAPE_FEATURES, SEGMENT_FEATURES

_FARTHEST_M = 10.0
_NEAR_M = 3.0


def gate_features(gates: Gates) -> NDArray[np.float64]:
    """(G, 75) the features of every candidate.

    The columns are those of ``GATE_FEATURES``, which defines them.
    """
    finest = gates.segmentation.scales[0]
    radius = finest.radius_m[gates.segments]
    order = np.argsort(radius, axis=1, kind="stable")
    small, large = np.take_along_axis(gates.segments, order, axis=1).T
    table, names = segment_features(finest), [spec.id for spec in SEGMENT_FEATURES]
    sides = [spec.id for spec in GATE_FEATURES if spec.id.startswith("small_")]
    columns = [names.index(id.removeprefix("small_")) for id in sides]
    shape = _shape_columns(gates, np.sort(radius, axis=1))
    return np.concatenate(
        [
            np.stack([shape[spec.id] for spec in GATE_SHAPE_FEATURES], axis=1),
            table[small][:, columns],
            table[large][:, columns],
            gates.profile_m,
        ],
        axis=1,
    )


def _shape_columns(gates: Gates, radius: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    half_width, width = gates.openings.half_width_m, gates.width_m
    nearest, near = _others(gates)
    parted = [_parted(gates, scale) for scale in (1, 2)]
    heading = gates.heading_rad - gates.segmentation.watershed.grid.yaw_rad
    return {
        "half_width": half_width,
        "width": width,
        "depth": gates.depth_m,
        "border": gates.openings.length_m,
        "saddle_to_small": half_width / radius[:, 0],
        "saddle_to_large": half_width / radius[:, 1],
        "width_to_small": width / (2 * radius[:, 0]),
        "width_to_large": width / (2 * radius[:, 1]),
        "tilt": np.abs(np.sin(2 * heading)),
        "nearest_gate": nearest,
        "gates_near": near,
        "gaps": _same_pair(gates),
        "parted_0.75": parted[0],
        "parted_0.6": parted[1],
    }


def _others(gates: Gates) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(G,) distance to the nearest other candidate, and the number of others nearby."""
    nearest, near = np.full(len(gates), _FARTHEST_M), np.zeros(len(gates))
    if len(gates):
        # No gate beyond the next field is nearer than the farthest that counts.
        field = np.floor((gates.centre_m - gates.centre_m.min(axis=0)) / _FARTHEST_M)
        rows, columns = field.astype(np.int64).T
        n_columns = columns.max() + 1
        number = rows * n_columns + columns
        order = np.argsort(number, kind="stable")
        start = np.searchsorted(number[order], np.arange((rows.max() + 1) * n_columns + 1))
        fields = start, order, n_columns
        distances_to_others(gates.centre_m, number, *fields, _NEAR_M, nearest, near)
    return nearest, near


def _same_pair(gates: Gates) -> NDArray[np.float64]:
    _, pair, number = np.unique(gates.segments, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(number[pair.reshape(-1)], np.float64)


def _parted(gates: Gates, scale: int) -> NDArray[np.float64]:
    """(G,) 1 if a scale separates the basins beside the gate, or if there is no such scale."""
    scales = gates.segmentation.scales
    if scale >= len(scales):
        return np.ones(len(gates))
    sides = scales[scale].of_basins(gates.openings.basins)
    return np.asarray(sides[:, 0] != sides[:, 1], np.float64)
