"""A line chart as inline SVG that takes its colours from the page, in daylight and in the dark."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.report.markup import Markup, element

__all__ = ["Series", "line_chart", "spans_decades"]

_WIDTH, _HEIGHT = 420, 270
_LEFT, _RIGHT, _TOP, _BOTTOM = 88, 12, 12, 44
_MOST_POINTS = 200
_LOG_SPAN = 100.0
"""Positive values that span more than this factor are drawn on a logarithmic axis."""


@dataclass(frozen=True)
class Series:
    """A named line; ``style`` picks its colour and dashes."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    style: int


@dataclass(frozen=True)
class _Axis:
    """Values from ``low`` to ``high`` on pixels from ``start`` to ``stop``."""

    low: float
    high: float
    start: float
    stop: float
    log: bool = False
    whole: bool = False

    def at(self, value: float) -> float:
        low, high, value = (
            (math.log10(part) for part in (self.low, self.high, value))
            if self.log
            else (self.low, self.high, value)
        )
        return self.start + (value - low) / (high - low) * (self.stop - self.start)

    def ticks(self) -> list[tuple[float, str]]:
        """Round values within the axis, and how to write them."""
        if self.log:
            first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
            every = max(1, (last - first + 4) // 5)
            return [(10.0**power, _power(power)) for power in range(first, last + 1, every)]
        step = _round_step((self.high - self.low) / 4)
        step = max(1.0, step) if self.whole else step
        first = math.ceil(self.low / step - 1e-9)
        values = [k * step for k in range(first, math.floor(self.high / step + 1e-9) + 1)]
        return [(value, _number(value, step)) for value in values]


def line_chart(
    series: Sequence[Series],
    *,
    x_name: str,
    y_name: str,
    limits: tuple[float, float] | None = None,
    diagonal: bool = False,
    markers: bool = False,
) -> Markup:
    """The chart and its legend as one figure.

    Points that are not finite are left out. ``limits`` fixes both axes; without it they follow the
    values, and positive values that spread over more than a factor of 100 get a logarithmic axis.
    """
    lines = [_finite(item) for item in series]
    lines = [(item, x, y) for item, x, y in lines if len(x)]
    if not lines:
        return Markup("")
    x_axis, y_axis = _axes(lines, limits)
    parts = [_grid(x_axis, y_axis, x_name, y_name)]
    if diagonal:
        ends = _points(np.array([0.0, 1.0]), np.array([0.0, 1.0]), x_axis, y_axis)
        parts.append(element("polyline", points=ends, class_="diagonal"))
    for item, x, y in lines:
        style = f"line m{item.style % 6}"
        if len(x) > 1:
            points = _points(x, y, x_axis, y_axis)
            parts.append(element("polyline", points=points, class_=style))
        if markers or len(x) == 1:
            parts += [
                element(
                    "circle",
                    cx=f"{x_axis.at(a):.1f}",
                    cy=f"{y_axis.at(b):.1f}",
                    r=3,
                    class_=f"dot m{item.style % 6}",
                )
                for a, b in zip(x, y, strict=True)
            ]
    spoken = "; ".join(f"{i.name}: from {y[0]:.4g} to {y[-1]:.4g}" for i, _, y in lines)
    drawing = element(
        "svg",
        *parts,
        viewBox=f"0 0 {_WIDTH} {_HEIGHT}",
        role="img",
        aria_label=f"{y_name} over {x_name}. {spoken}",
    )
    return element("figure", drawing, _legend([item for item, _, _ in lines]), class_="chart")


def spans_decades(values: NDArray[np.float64]) -> bool:
    """Whether values are positive and spread so far that a logarithmic axis shows more."""
    return len(values) > 0 and bool(0 < values.min() < values.max() / _LOG_SPAN)


def _finite(item: Series) -> tuple[Series, NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.asarray(item.x, np.float64), np.asarray(item.y, np.float64)
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) > _MOST_POINTS:
        kept = np.unique(np.round(np.linspace(0, len(x) - 1, _MOST_POINTS)).astype(int))
        x, y = x[kept], y[kept]
    return item, x, y


def _axes(
    lines: Sequence[tuple[Series, NDArray[np.float64], NDArray[np.float64]]],
    limits: tuple[float, float] | None,
) -> tuple[_Axis, _Axis]:
    across, up = (_LEFT, _WIDTH - _RIGHT), (_HEIGHT - _BOTTOM, _TOP)
    if limits is not None:
        return _Axis(*limits, *across), _Axis(*limits, *up)
    x = np.concatenate([line[1] for line in lines])
    y = np.concatenate([line[2] for line in lines])
    log = spans_decades(y)
    low, high = float(y.min()), float(y.max())
    if log:
        low, high = 10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high))
    else:
        margin = 0.06 * (high - low) or 0.05 * abs(high) or 0.5
        low, high = low - margin, high + margin
    x_high = float(x.max()) if x.max() > x.min() else float(x.min()) + 1.0
    whole = bool((x == np.round(x)).all())
    return _Axis(float(x.min()), x_high, *across, whole=whole), _Axis(low, high, *up, log=log)


def _round_step(step: float) -> float:
    power = 10.0 ** math.floor(math.log10(step))
    return next(power * unit for unit in (1, 2, 2.5, 5, 10) if power * unit >= step * (1 - 1e-9))


def _points(x: NDArray[np.float64], y: NDArray[np.float64], x_axis: _Axis, y_axis: _Axis) -> str:
    return " ".join(f"{x_axis.at(a):.1f},{y_axis.at(b):.1f}" for a, b in zip(x, y, strict=True))


def _grid(x_axis: _Axis, y_axis: _Axis, x_name: str, y_name: str) -> Markup:
    bottom, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    parts = []
    for value, text in y_axis.ticks():
        y = f"{y_axis.at(value):.1f}"
        parts.append(element("line", x1=_LEFT, x2=right, y1=y, y2=y, class_="grid"))
        parts.append(_label(_LEFT - 8, float(y) + 4, text, "end"))
    for value, text in x_axis.ticks():
        x = f"{x_axis.at(value):.1f}"
        parts.append(element("line", x1=x, x2=x, y1=bottom, y2=bottom + 4, class_="axis"))
        parts.append(_label(float(x), bottom + 18, text, "middle"))
    parts.append(element("line", x1=_LEFT, x2=right, y1=bottom, y2=bottom, class_="axis"))
    parts.append(_label((_LEFT + right) / 2, _HEIGHT - 8, x_name, "middle"))
    middle = (bottom + _TOP) / 2
    parts.append(_label(14, middle, y_name, "middle", transform=f"rotate(-90 14 {middle:g})"))
    return element("g", *parts)


def _label(x: float, y: float, text: str, anchor: str, **attributes: str) -> Markup:
    return element("text", text, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor=anchor, **attributes)


def _number(value: float, step: float) -> str:
    """The value with as many digits as neighbours a step apart need."""
    size = abs(value)
    if size >= 1e7 or 0 < size < 1e-4:
        digits = max(0, math.ceil(math.log10(size / step) - 1e-9))
        text = f"{value:.{min(digits, 6)}e}".replace("e+0", "e").replace("e-0", "e-")
    else:
        decimals = max(0, math.ceil(-math.log10(step) - 1e-9))
        decimals += step * 10**decimals % 1 > 1e-9  # steps of 2.5
        text = f"{value:,.{decimals}f}"
    return text.replace("-", "−")


def _power(power: int) -> str:
    return f"{10.0**power:g}".replace("e+0", "e").replace("e-0", "e−")


def _legend(series: Sequence[Series]) -> Markup:
    entries = [
        element(
            "li",
            element(
                "svg",
                element("line", x1=0, x2=28, y1=6, y2=6, class_=f"line m{item.style % 6}"),
                viewBox="0 0 28 12",
                aria_hidden="true",
            ),
            item.name,
        )
        for item in series
    ]
    return element("figcaption", element("ul", *entries, class_="lines"))
