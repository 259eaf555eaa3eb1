"""Line charts: SVG images by matplotlib, in the light or dark colours of the page around them."""

import io
import re
import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.pictures.drawing import INK
from pgm_places.pictures.page import data_uri, template_text

_DPI = 100


class PixelFigure:
    """A white figure whose parts are placed by pixels from the upper left corner."""

    def __init__(self, width: int, height: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.width, self.height = width, height
        size = (width / _DPI, height / _DPI)
        self.figure = Figure(figsize=size, dpi=_DPI, facecolor="white")
        FigureCanvasAgg(self.figure)

    def axes(self, x: int, y: int, width: int, height: int) -> Any:
        """Axes with the upper left corner at a pixel."""
        box = (
            x / self.width,
            1 - (y + height) / self.height,
            width / self.width,
            height / self.height,
        )
        return self.figure.add_axes(box)

    def text(self, x: float, y: float, content: str, *, size: int = 14, **options: Any) -> None:
        """A line of text, its size in pixels; dollar signs do not mark mathematics."""
        options = {"color": INK, "va": "center", "ha": "left", **options}
        self.figure.text(
            x / self.width,
            1 - y / self.height,
            content,
            fontsize=size * 72 / _DPI,
            parse_math=False,
            **options,
        )

    def box(self, x: float, y: float, width: float, height: float, **options: Any) -> None:
        """A rectangle with its upper left corner at a pixel."""
        from matplotlib.patches import Rectangle

        corner = (x / self.width, 1 - (y + height) / self.height)
        sides = (width / self.width, height / self.height)
        patch = Rectangle(corner, *sides, transform=self.figure.transFigure, **options)
        self.figure.add_artist(patch)

    def png(self) -> bytes:
        """The picture as a PNG file without a date or a version in it."""
        return self._saved(format="png", metadata={"Software": None})

    def svg(self) -> str:
        """The picture as an SVG file without a background, its text as text, without a date."""
        from matplotlib import rc_context

        with rc_context({"svg.fonttype": "none", "svg.hashsalt": "pgm-places"}):
            nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
            return self._saved(format="svg", transparent=True, metadata=nothing).decode("utf-8")

    def _saved(self, **options: Any) -> bytes:
        buffer = io.BytesIO()
        with warnings.catch_warnings():
            # Label names may be in any script; a missing glyph is no reason to fail.
            warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
            self.figure.savefig(buffer, dpi=_DPI, **options)
        return buffer.getvalue()


_WIDTH, _PLOT_HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM, _LEGEND_LINE = 460, 230, 84, 16, 22, 52, 20
_TEXT_PT, _TICK_PT = 9.5, 8.5
_LONGEST_NAME = 62
_LOG_SPAN = 100.0
"""Positive values that span more than this factor are drawn on a logarithmic axis."""

_N_STYLES = 6
_DASHES = ((), (5, 2.5), (1.3, 2), (6, 2, 1.3, 2), (3, 1.5), (8, 2.5))
_VARIABLES = ("ink", "muted", "rule", *(f"m{style}" for style in range(_N_STYLES)))
_STAND_IN = {name: f"#abcd{index:02x}" for index, name in enumerate(_VARIABLES)}
"""Placeholder colours for the variables of theme.css: matplotlib does not support CSS."""


@dataclass(frozen=True)
class Line:
    """A named line; ``style`` picks its colour and dashes."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    style: int

    @classmethod
    def over_steps(cls, name: str, values: Sequence[float], style: int) -> Self:
        """Values of the steps 1, 2, ..."""
        return cls(name, range(1, len(values) + 1), values, style)

    def finite(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The points with two finite coordinates."""
        x, y = np.asarray(self.x, np.float64), np.asarray(self.y, np.float64)
        good = np.isfinite(x) & np.isfinite(y)
        return x[good], y[good]


@dataclass(frozen=True)
class Chart:
    """A chart as an image of a page: the SVG file, and a description for screen readers."""

    svg: str
    words: str

    @property
    def source(self) -> str:
        """The data URI of the image."""
        return data_uri(self.svg.encode("utf-8", "replace"), "image/svg+xml")


def line_chart(
    lines: Sequence[Line], *, x_name: str, y_name: str, shares: bool = False
) -> Chart | None:
    """The chart with its legend, of finite points; None if there are none.

    Positive values beyond a factor of 100 get a logarithmic axis. With ``shares``, both axes go
    from 0 to 1, with a diagonal.
    """
    drawn = [(line, *line.finite()) for line in lines]
    drawn = [item for item in drawn if len(item[1])]
    if not drawn:
        return None
    height = _TOP + _PLOT_HEIGHT + _BOTTOM + _LEGEND_LINE * len(drawn)
    page = PixelFigure(_WIDTH, height)
    axes = page.axes(_LEFT, _TOP, _WIDTH - _LEFT - _RIGHT, _PLOT_HEIGHT)
    for line, x, y in drawn:
        [artist] = axes.plot(x, y, **_style(line.style, marked=shares or len(x) == 1))
        artist.set_label(textwrap.shorten(line.name, _LONGEST_NAME, placeholder="…"))
    _decorate(axes, x_name, y_name)
    if shares:
        axes.plot([0, 1], [0, 1], color=_STAND_IN["muted"], linewidth=0.9, linestyle=":")
        axes.set(xlim=(0, 1), ylim=(0, 1.02))
    else:
        _scale(axes, drawn)
    _legend(page, axes)
    ends = "; ".join(f"{line.name}: from {y[0]:.4g} to {y[-1]:.4g}" for line, _, y in drawn)
    return Chart(_themed(page.svg()), f"{y_name} over {x_name}. {ends}")


def _style(style: int, *, marked: bool) -> dict[str, Any]:
    kind = style % _N_STYLES
    return {
        "color": _STAND_IN[f"m{kind}"],
        "linestyle": (0, _DASHES[kind]) if _DASHES[kind] else "-",
        "linewidth": 1.5,
        "marker": "o" if marked else "",
        "markersize": 3.5,
        "gid": f"line-{style}",
    }


def _decorate(axes: Any, x_name: str, y_name: str) -> None:
    muted = _STAND_IN["muted"]
    for axis, name in ((axes.xaxis, x_name), (axes.yaxis, y_name)):
        axis.set_label_text(name, fontsize=_TEXT_PT, color=muted, parse_math=False)
    axes.tick_params(labelsize=_TICK_PT, colors=muted)
    axes.yaxis.offsetText.set(color=muted, fontsize=_TICK_PT)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=True, axis="y", color=_STAND_IN["rule"], linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set_color(muted)


def _scale(
    axes: Any, drawn: Sequence[tuple[Line, NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    """Set integer ticks of the steps, and few ticks of the values."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, ScalarFormatter

    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True, min_n_ticks=1, steps=[1, 2, 5, 10]))
    y = np.concatenate([item[2] for item in drawn])
    if 0 < y.min() < y.max() / _LOG_SPAN:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(numticks=6))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter("{x:g}")
    else:
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False, useMathText=False))


def _legend(page: PixelFigure, axes: Any) -> None:
    """Below the axes, a line each."""
    handles, names = axes.get_legend_handles_labels()
    legend = page.figure.legend(
        handles,
        names,
        loc="lower left",
        bbox_to_anchor=(0.0, 0.0),
        fontsize=_TEXT_PT,
        labelcolor=_STAND_IN["muted"],
        frameon=False,
        handlelength=3.2,
        borderaxespad=0.2,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def _themed(svg: str) -> str:
    """The drawing with the page's CSS variables in place of the placeholder colours."""
    style = f"{template_text('theme.css')}text {{ font-family: system-ui, sans-serif !important }}"
    svg = re.sub(r"#abcd(\d\d)", lambda found: f"var(--{_VARIABLES[int(found[1], 16)]})", svg)
    return re.sub(r"(<svg [^>]*>)", lambda found: f"{found[1]}<style>{style}</style>", svg, count=1)
