"""Kernels that handle lanes in parts give the same bits whatever the processor's registers."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.features._fourier_kernels import fourier_features
from pgm_places.features._polygon_kernels import moment_features
from pgm_places.features.extraction import extract
from pgm_places.features.laser import LASER_FEATURES
from pgm_places.kernels.deferred import IS_COMPILED, by_registers
from pgm_places.kernels.jit import njit
from pgm_places.kernels.lanes import LANES, aligned_planes, fma, largest, load, select, store
from pgm_places.kernels.parts import PART, alike, part, room
from tests.features.scans import rooms

Planes = NDArray[np.float64]

MANY: bool = by_registers(many=True, few=False)


@njit
def _is_for_many() -> bool:
    return MANY


@njit
def _halved(planes: Planes, spare: Planes, out: Planes) -> int:
    """Numbers and vectors in one call; returns the number of parts."""
    n_parts = 0
    for lane in range(0, LANES, PART):
        x = load(part(planes, lane), 1)
        number = alike(x, -1.0)
        store(room(spare), 2, fma(x, 0.5, select(x < 0.0, number, 0.0)))
        store(part(out, lane), 0, largest(load(room(spare), 2), 0.25))
        n_parts += 1
    return n_parts


def test_parts_are_computed_like_all_lanes() -> None:
    planes, spare, out = (aligned_planes(3, np.float64) for _ in range(3))
    planes[:] = np.random.default_rng(0).normal(size=planes.shape)
    n_parts = _halved(planes, spare, out)
    assert n_parts == (1 if _is_for_many() else 2)
    x = planes[1]
    np.testing.assert_array_equal(out[0], np.maximum(x / 2 - (x < 0), 0.25))


@pytest.fixture
def other_registers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels compiled for 32 registers of sixteen floats where there are fewer, or the reverse."""
    from pgm_places.kernels import compiling, kernel, part_rules

    many = part_rules.has_many_registers()
    monkeypatch.setattr(part_rules, "has_many_registers", lambda: not many)
    monkeypatch.setattr(compiling, "_made", {})
    monkeypatch.setattr(compiling, "_FOLDER", None)
    monkeypatch.setattr(kernel, "load_code", lambda *_: None)
    changed: tuple[Any, ...] = (_is_for_many, fourier_features, moment_features)
    for item in changed:
        monkeypatch.setattr(item, "_codes", {})


@pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled")
def test_features_have_the_same_bits_for_other_registers(request: pytest.FixtureRequest) -> None:
    scans = rooms(3 * LANES - 5, seed=3)
    families = ("f16", "f17", "f21")
    columns = [k for k, spec in enumerate(LASER_FEATURES) if spec.id in families]
    few = [columns[k] for k in (0, 3, 4, 90, 91, 92, 93, 94, 95, 96, 97, 120)]
    expected = [extract(scans, max_range_m=30.0, columns=chosen) for chosen in (columns, few)]
    before = _is_for_many()
    request.getfixturevalue("other_registers")
    assert _is_for_many() != before
    for chosen, wanted in zip((columns, few), expected, strict=True):
        found = extract(scans, max_range_m=30.0, columns=chosen)
        np.testing.assert_array_equal(found, wanted)
