"""Scans are scored one by one as in a table, to the last bit."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import Sensor
from pgm_places.errors import InputError
from pgm_places.features.custom import Feature
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.unary.scan_model import ScanModel, ScanScorer
from tests.refusals import refused


@dataclass(frozen=True)
class Shortest:
    """The shortest beam."""

    column_names: ClassVar[tuple[str, ...]] = ("shortest",)

    def of_scans(self, ranges_m: NDArray[np.float32], max_range_m: float) -> NDArray[np.float32]:
        return ranges_m.min(axis=1, keepdims=True)


def scans(n_beams: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(0)
    return rng.uniform(0.2, 14.0, (40, n_beams)).astype(np.float32)


def model(n_beams: int, n_extra: int, features: tuple[Feature, ...] = ()) -> ScanModel:
    """A list that looks at all kinds of columns."""
    rng = np.random.default_rng(1)
    width = 321 + len(features) + n_extra
    table = rng.normal(size=(200, width)).astype(np.float32)
    truth = (table[:, -1] + table[:, 3] > 0).astype(int) + (table[:, 150] > 0.5)
    fitted = DecisionListClassifier(20, order=[0, 1, 2]).fit(table, truth)
    names = tuple(f"object {k}" for k in range(n_extra))
    sensor = Sensor(n_beams=n_beams, max_range_m=12.0)
    return ScanModel(fitted.boosted_list_, 3, sensor, names, features)


@pytest.mark.parametrize("n_beams", [360, 180])
@pytest.mark.parametrize("n_extra", [0, 2])
@pytest.mark.parametrize("features", [(), (Shortest(),)])
def test_one_by_one_has_the_bits_of_all_together(
    n_beams: int, n_extra: int, features: tuple[Feature, ...]
) -> None:
    built, circles = model(n_beams, n_extra, features), scans(n_beams)
    extra = np.random.default_rng(2).poisson(1.0, (40, n_extra)) if n_extra else None
    scorer = ScanScorer(built)
    rows = [
        scorer.log_proba(circle, None if extra is None else extra[t])
        for t, circle in enumerate(circles)
    ]
    np.testing.assert_array_equal(rows, built.log_proba(circles, extra))


def test_extra_columns_must_be_those_that_were_learned() -> None:
    circle = scans(360)[0]
    with pytest.raises(InputError, match="also looks at object 0, object 1"):
        ScanScorer(model(360, 2)).log_proba(circle)
    with pytest.raises(InputError, match=r"extra must have shape \(1, 2\), got \(1, 3\)"):
        ScanScorer(model(360, 2)).log_proba(circle, [1, 2, 3])
    refused(InputError, "looks at the laser only", ScanScorer(model(360, 0)).log_proba, circle, [1])
