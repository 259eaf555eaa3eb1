"""Grid of map panels with titles, scale bar, legend or colour bar."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pgm_places.palette import Swatch, levels
from pgm_places.pictures.canvas import Canvas
from pgm_places.pictures.drawing import INK, MUTED, Drawing, text_width

_LEAST_WIDTH = 420


_LARGEST_CELL = 12
"""Most pixels along the side of a cell, so that small maps do not fill a screen."""


_WIDE = 1500
"""From this width on, text and bars are 1.5 times as large, as the figure is viewed shrunk."""


@dataclass(frozen=True)
class Panel:
    """A map, its title, and an overlay drawn on the enlarged map by the factor passed."""

    canvas: Canvas
    title: str = ""
    overlay: Callable[[Drawing, int], None] | None = None


@dataclass(frozen=True)
class ColourBar:
    """A gradient with the text at its ends."""

    gradient: str
    caption: str
    low: str = "0"
    high: str = "1"


@dataclass(frozen=True)
class _Sizes:
    """Pixels of everything around the maps."""

    edge: int
    gap: int
    title: int
    text: int
    swatch: int
    line: int

    @classmethod
    def for_width(cls, width: int) -> "_Sizes":
        sizes = (24, 28, 20, 15, 18, 30)
        return cls(*(3 * size // 2 if width > _WIDE else size for size in sizes))


def figure_grid(
    panels: Sequence[Panel],
    *,
    columns: int = 1,
    title: str | None = None,
    legend: Sequence[Swatch] = (),
    bars: Sequence[ColourBar] = (),
    scale_bar: bool = True,
    long_side: int = 2400,
) -> Drawing:
    """The panels in a grid, enlarged by the largest integer that fits into ``long_side`` pixels."""
    shapes = np.array([panel.canvas.indices.shape for panel in panels])
    columns = min(columns, len(panels))
    most = min(long_side // columns // int(shapes[:, 1].max()), long_side // int(shapes.max()))
    scale = min(max(1, most), _LARGEST_CELL)
    high, wide = (int(side) for side in scale * shapes.max(axis=0))
    sizes = _Sizes.for_width(columns * wide)
    content = max(_LEAST_WIDTH, columns * wide + (columns - 1) * sizes.gap)
    lines = _flow(legend, content, sizes)
    n_rows = -(-len(panels) // columns)
    head = (2 * sizes.title) if title else 0
    above = sizes.text + 12 if any(panel.title for panel in panels) else 0
    below = sizes.line if scale_bar else 6
    row_height = above + high + below + 8
    foot = len(lines) * sizes.line + (sizes.line + 10) * bool(bars)
    page = Drawing(content + 2 * sizes.edge, 2 * sizes.edge + head + n_rows * row_height - 8 + foot)
    if title:
        page.text(sizes.edge, sizes.edge + sizes.title // 2, title, size=sizes.title, bold=True)
    for index, panel in enumerate(panels):
        row, column = divmod(index, columns)
        x = sizes.edge + column * (wide + sizes.gap)
        y = sizes.edge + head + row * row_height
        if panel.title:
            page.text(x, y + sizes.text // 2, panel.title, size=sizes.text, colour=MUTED)
        drawn = Drawing.of(panel.canvas, scale)
        if panel.overlay is not None:
            panel.overlay(drawn, scale)
        page.paste(drawn, x, y + above)
        if scale_bar and column == 0:
            under = y + above + scale * panel.canvas.indices.shape[0] + 8
            draw_scale_bar(page, panel.canvas, (x, under), scale, size=sizes.text - 1)
    y = page.image.height - sizes.edge - foot + 10
    for line in lines:
        _draw_legend_line(page, line, y, sizes)
        y += sizes.line
    _draw_bars(page, bars, y + 6, sizes)
    return page


def round_length(metres: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is at most the given length."""
    power = 10.0 ** np.floor(np.log10(metres))
    return float(power * max(step for step in (1, 2, 5) if step * power <= metres * (1 + 1e-9)))


def draw_scale_bar(
    page: Drawing, canvas: Canvas, corner: tuple[int, int], scale: int, *, size: int
) -> None:
    """A bar of a round length below an enlarged map; the size of its text is in pixels."""
    x, y = corner
    metres = round_length(canvas.m_per_pixel * canvas.indices.shape[1] / 5)
    length, tick = metres / canvas.m_per_pixel * scale, (size + 1) * 2 // 3
    page.box(x, y + tick / 2 - 1.5, length, 3, fill=INK)
    for end in (x, x + length - 2):
        page.box(end, y, 2, tick, fill=INK)
    page.text(x + length + 8, y + tick / 2, f"{metres:g} m", size=size)


def _flow(legend: Sequence[Swatch], width: int, sizes: _Sizes) -> list[list[tuple[float, Swatch]]]:
    """The entries of a legend, broken into lines of the width, with their positions."""
    lines: list[list[tuple[float, Swatch]]] = []
    x = 0.0
    for entry in legend:
        needed = sizes.swatch + 8 + text_width(entry.name, sizes.text)
        if not lines or x + needed > width:
            lines.append([])
            x = 0.0
        lines[-1].append((x, entry))
        x += needed + 26
    return lines


def _draw_legend_line(
    page: Drawing, line: list[tuple[float, Swatch]], y: int, sizes: _Sizes
) -> None:
    for x, entry in line:
        left, middle = sizes.edge + x, y + sizes.line / 2
        top = middle - sizes.swatch / 2
        if entry.hatched:
            page.hatched_box(left, top, sizes.swatch, fill=entry.colour, hatch="#b5b5b5")
        else:
            page.box(left, top, sizes.swatch, sizes.swatch, fill=entry.colour, edge=MUTED)
        page.text(left + sizes.swatch + 8, middle, entry.name, size=sizes.text)


def _draw_bars(page: Drawing, bars: Sequence[ColourBar], y: int, sizes: _Sizes) -> None:
    x, middle, step = float(sizes.edge), y + sizes.swatch / 2, sizes.swatch // 2
    for bar in bars:
        before = f"{bar.caption}: {bar.low}"
        page.text(x, middle, before, size=sizes.text)
        x += text_width(before, sizes.text) + 10
        for colour in levels(bar.gradient, 24):
            page.box(x, y, step, sizes.swatch, fill=colour)
            x += step
        page.text(x + 8, middle, bar.high, size=sizes.text)
        x += 8 + text_width(bar.high, sizes.text) + 40
