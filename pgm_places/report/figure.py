"""Figures measured in pixels: matplotlib without pyplot or a window, with reproducible bytes."""

import io
import warnings
from typing import Any

INK, MUTED = "#1a202c", "#5a6472"
_DPI = 100


class PixelFigure:
    """A white figure whose parts are placed by pixels from the upper left corner.

    Parameters
    ----------
    width, height : int
        Size of the picture in pixels.
    """

    def __init__(self, width: int, height: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.width, self.height = width, height
        size = (width / _DPI, height / _DPI)
        self.figure = Figure(figsize=size, dpi=_DPI, facecolor="white")
        FigureCanvasAgg(self.figure)

    def axes(self, x: int, y: int, width: int, height: int) -> Any:
        """Axes with their upper left corner at a pixel."""
        box = (
            x / self.width,
            1 - (y + height) / self.height,
            width / self.width,
            height / self.height,
        )
        return self.figure.add_axes(box)

    def text(self, x: float, y: float, content: str, *, size: int = 14, **options: Any) -> None:
        """A line of text, its size in pixels; dollar signs are not taken for mathematics."""
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
            # Label names may be in any script; a box in place of a letter is no reason to fail.
            warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
            self.figure.savefig(buffer, dpi=_DPI, **options)
        return buffer.getvalue()
