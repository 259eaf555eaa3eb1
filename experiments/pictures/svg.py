"""The parts of a diagram: an SVG whose colours are those of the page around it."""

from html import escape
from pathlib import Path

STATIC = Path(__file__).resolve().parents[2] / "docs" / "_static"

STYLE = """\
.chart text { font: 14px var(--pst-font-family-base, sans-serif); fill: var(--pst-color-text-base, #222); }
.chart .head { font-weight: 600; }
.chart .small { font-size: 13px; fill: var(--pst-color-text-muted, #555); }
.chart .code { font-family: var(--pst-font-family-monospace, monospace); font-size: 13px; }
.chart rect { fill: var(--pst-color-surface, #f3f4f5); stroke: var(--pst-color-border, #c9ccd1); }
.chart .front rect { fill: var(--pst-color-background, #fff); }
.chart path { fill: none; stroke: var(--pst-color-text-muted, #555); stroke-width: 1.5; }
"""  # noqa: E501

_HEAD = (
    '<defs><marker id="head" viewBox="0 0 8 8" refX="6" refY="4" markerWidth="7" '
    'markerHeight="7" orient="auto"><path d="M0 0 L8 4 L0 8"/></marker></defs>'
)


def svg(width: float, height: float, title: str, parts: list[str]) -> str:
    """The whole diagram, at about its own size; screen readers read its title out."""
    return "\n".join(
        [
            f'<svg class="chart" viewBox="0 0 {width} {height}" role="group" '
            f'style="min-width: {round(0.8 * width)}px; max-width: {round(1.15 * width)}px" '
            'aria-labelledby="chart-title" xmlns="http://www.w3.org/2000/svg">',
            f'<title id="chart-title">{escape(title)}</title>',
            f"<style>{STYLE}</style>",
            _HEAD,
            *parts,
            "</svg>",
            "",
        ]
    )


def write(name: str, content: str) -> None:
    """Keep a diagram as docs/_static/NAME.svg."""
    path = STATIC / f"{name}.svg"
    path.write_text(content, encoding="utf-8")
    print(f"wrote {path}")


def box(x: float, y: float, width: float, height: float, radius: int = 8) -> str:
    """A rectangle with round corners."""
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="{radius}"/>'


def text(x: float, y: float, content: str, style: str = "", anchor: str = "middle") -> str:
    """A line whose middle height is y."""
    kind = f' class="{style}"' if style else ""
    content = escape(content)
    return f'<text x="{x}" y="{y + 5}" text-anchor="{anchor}"{kind}>{content}</text>'


def arrow(*points: tuple[float, float]) -> str:
    """A line through the points with a head at its end."""
    way = " L".join(f"{x} {y}" for x, y in points)
    return f'<path d="M{way}" marker-end="url(#head)"/>'
