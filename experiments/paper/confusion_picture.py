"""A confusion matrix as a picture."""

import textwrap
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pgm_places._checks import finite_array
from pgm_places.pictures.drawing import INK, MUTED
from pgm_places.report.line_chart import PixelFigure

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
