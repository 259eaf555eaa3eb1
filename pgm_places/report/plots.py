"""Plots of a comparison: confusion matrix, history of the iterations, reliability of beliefs."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.palette import METHOD_COLOURS
from pgm_places.report.figure import INK, MUTED, PixelFigure
from pgm_places.report.line_chart import spans_decades

if TYPE_CHECKING:
    from pgm_places.evaluation.evaluation import Reliability

__all__ = ["confusion_picture", "history_plot", "reliability_plot"]

_DASHES = ("-", "--", "-.", ":")
_TEXT = 10.0


def confusion_picture(
    confusion: ArrayLike, label_names: Sequence[str], *, title: str | None = None
) -> bytes:
    """A PNG file of a confusion matrix: counts, and shares of each true label in colour.

    Parameters
    ----------
    confusion : (K, K) int
        Rows are true labels, columns predicted ones.
    label_names : sequence of str
    title : str or None

    Raises
    ------
    InputError
        A matrix of another size.
    """
    size = len(label_names)
    counts = finite_array("confusion", confusion, (size, size))
    totals = counts.sum(axis=1, keepdims=True)
    shares = np.divide(counts, totals, out=np.zeros_like(counts), where=totals > 0)
    side, left, top = max(90, min(130, 900 // size)), 190, 140 if title else 96
    page = PixelFigure(left + side * size + 40, top + side * size + 30)
    if title:
        page.text(24, 30, title, size=20, weight="bold")
    axes = page.axes(left, top, side * size, side * size)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    axes.xaxis.tick_top()
    axes.xaxis.set_label_position("top")
    names = [textwrap.shorten(name, 20, placeholder="…") or name[:20] for name in label_names]
    for set_ticks in (axes.set_xticks, axes.set_yticks):
        set_ticks(range(size), names, fontsize=_TEXT, color=INK, parse_math=False)
    axes.set_xlabel("predicted", fontsize=_TEXT, color=MUTED, labelpad=12)
    axes.set_ylabel("true", fontsize=_TEXT, color=MUTED, labelpad=12)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    for true in range(size):
        for predicted in range(size):
            share, count = shares[true, predicted], counts[true, predicted]
            words = f"{100 * share:.1f} %\n{count:,.0f}" if totals[true] else "no cells"
            colour = "white" if share > 0.55 else INK
            axes.text(
                predicted, true, words, ha="center", va="center", color=colour, fontsize=_TEXT
            )
    return page.png()


def history_plot(
    histories: Mapping[str, Mapping[str, Sequence[float]]], *, title: str | None = None
) -> bytes:
    """A PNG file with a plot per quantity (change, energy, accuracy ...) over the iterations.

    ``histories`` holds, by method, the values of each quantity.

    Raises
    ------
    InputError
        No history at all.
    """
    quantities = sorted({name for history in histories.values() for name in history})
    if not quantities:
        raise InputError("histories must hold at least one quantity of one method, got none")
    width, top = 420, 60 if title else 20
    page = PixelFigure(max(width * len(quantities), 460), top + 380)
    if title:
        page.text(24, 30, title, size=20, weight="bold")
    for index, quantity in enumerate(quantities):
        axes = _axes(page, index * width + 70, top + 24, "iteration", quantity)
        lines = [(m, history[quantity]) for m, history in histories.items() if quantity in history]
        for at, (method, values) in enumerate(lines):
            axes.plot(range(1, len(values) + 1), values, label=method, **_line(at))
        if spans_decades(np.concatenate([np.asarray(values) for _, values in lines])):
            axes.set_yscale("log")
        _legend(axes)
    return page.png()


def reliability_plot(tables: "Mapping[str, Reliability]", *, title: str | None = None) -> bytes:
    """A PNG file of how often predictions of a confidence are right, a line per method.

    On the diagonal beliefs say what they mean; below it they are too sure.

    Raises
    ------
    InputError
        No table at all.
    """
    if not tables:
        raise InputError("tables must hold the reliability of at least one method, got none")
    top = 60 if title else 20
    page = PixelFigure(480, top + 400)
    if title:
        page.text(24, 30, title, size=20, weight="bold")
    axes = _axes(page, 70, top + 10, "confidence", "share that is right", (370, 320))
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=0.8, linestyle=":")
    for at, (method, table) in enumerate(tables.items()):
        used = table.count > 0
        name = f"{method} (ECE {100 * table.expected_calibration_error:.1f} %)"
        line = _line(at) | {"marker": "o", "markersize": 4}
        axes.plot(table.mean_confidence[used], table.accuracy[used], label=name, **line)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1.02)
    _legend(axes)
    return page.png()


def _axes(
    page: PixelFigure,
    x: int,
    y: int,
    x_name: str,
    y_name: str,
    size: tuple[int, int] = (320, 290),
) -> Any:
    axes = page.axes(x, y, *size)
    axes.set_xlabel(x_name, fontsize=_TEXT, color=MUTED, parse_math=False)
    axes.set_ylabel(y_name, fontsize=_TEXT, color=MUTED, parse_math=False)
    axes.tick_params(labelsize=9, colors=MUTED)
    axes.grid(visible=True, color="#e2e8f0", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["bottom", "left"]].set_color(MUTED)
    return axes


def _line(index: int) -> dict[str, Any]:
    return {
        "color": METHOD_COLOURS[index % len(METHOD_COLOURS)],
        "linestyle": _DASHES[index % len(_DASHES)],
        "linewidth": 1.8,
    }


def _legend(axes: Any) -> None:
    for text in axes.legend(fontsize=9, frameon=False).get_texts():
        text.set_parse_math(False)
