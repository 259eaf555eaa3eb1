"""The chart "which method?": an SVG whose colours are those of the page around it."""

from html import escape
from pathlib import Path

CHART = Path(__file__).resolve().parents[2] / "docs" / "_static" / "which_method.svg"

COLUMNS: dict[str, tuple[tuple[tuple[str, ...], str], ...]] = {
    "the steps of a sequence": (
        (("Does each label last about", "as long every time?"), "semi_markov"),
        (("Do edges have features, or must", "the scores be learned too?"), "crf"),
        (("Otherwise, also online",), "hmm"),
    ),
    "the cells of a map": (
        (("Many million cells, or beliefs", "for the next stage?"), "relaxation"),
        (("Are rare labels, such as door-", "ways, worth a false one?"), "amn"),
        (("Should gates and whole rooms", "have a say?"), "space_field"),
        (("Otherwise",), "potts"),
    ),
    "the nodes of another graph": (
        (("Do neighbours repel, follow", "or exclude each other?"), "crf"),
        (("Are there labels to learn", "from, if only of some nodes?"), "amn"),
        (("Otherwise",), "potts"),
    ),
}
"""For each kind of problem: questions from top to bottom, and the method if the answer is yes."""

WIDTH, HEIGHT = 1112, 560
COLUMN, GAP = 358, 19
TOP, STEP, BOX = 152, 92, 56
ASKS, METHOD = 224, 106

STYLE = """\
.chart text { font: 14px var(--pst-font-family-base, sans-serif); fill: var(--pst-color-text-base, #222); }
.chart .head { font-weight: 600; }
.chart .small { font-size: 13px; fill: var(--pst-color-text-muted, #555); }
.chart rect { fill: var(--pst-color-surface, #f3f4f5); stroke: var(--pst-color-border, #c9ccd1); }
.chart path { fill: none; stroke: var(--pst-color-text-muted, #555); stroke-width: 1.5; }
.chart a { text-decoration: none; }
.chart a rect { fill: var(--pst-color-primary, #0a7d91); stroke: none; }
.chart a text { fill: var(--pst-color-background, #fff); font-weight: 600; }
.chart a:hover rect, .chart a:focus rect { fill: var(--pst-color-link-hover, #064f5c); }
"""  # noqa: E501


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


def method(x: float, y: float, name: str, width: float = METHOD) -> str:
    """A method, which leads to its page."""
    return (
        f'<a href="{name}.html">{box(x, y, width, 34, 17)}{text(x + width / 2, y + 17, name)}</a>'
    )


def column(number: int, title: str) -> list[str]:
    """The questions of one kind of problem, below each other."""
    left = number * (COLUMN + GAP)
    middle = left + ASKS / 2
    parts = [
        arrow((WIDTH / 2, 50), (WIDTH / 2, 68), (middle, 68), (middle, 86)),
        box(left, 90, ASKS, 34),
        text(middle, 107, title, "head"),
    ]
    y = TOP
    for lines, name in COLUMNS[title]:
        last = len(lines) == 1
        parts.append(arrow((middle, y - 28 if y == TOP else y - 36), (middle, y - 4)))
        if y > TOP:
            parts.append(text(middle + 8, y - 22, "no", "small", "start"))
        parts.append(box(left, y, ASKS, BOX))
        first = y + BOX / 2 - 9 * (len(lines) - 1)
        parts += [text(middle, first + 18 * n, line, "small") for n, line in enumerate(lines)]
        parts.append(arrow((left + ASKS, y + BOX / 2), (left + ASKS + 24, y + BOX / 2)))
        if not last:
            parts.append(text(left + ASKS + 12, y + BOX / 2 - 11, "yes", "small"))
        parts.append(method(left + ASKS + 28, y + (BOX - 34) / 2, name))
        y += STEP
    return parts


def which_method() -> None:
    """Write the chart; every method in it is a link."""
    parts = [
        f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        'aria-labelledby="chart-title" xmlns="http://www.w3.org/2000/svg">',
        '<title id="chart-title">Which method? Questions that lead from the kind of problem '
        "to a method</title>",
        f"<style>{STYLE}</style>",
        '<defs><marker id="head" viewBox="0 0 8 8" refX="6" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0 L8 4 L0 8"/></marker></defs>',
        box(WIDTH / 2 - 110, 12, 220, 38),
        text(WIDTH / 2, 31, "What is to be labelled?", "head"),
    ]
    for number, title in enumerate(COLUMNS):
        parts += column(number, title)
    y = HEIGHT - 26
    parts += [
        text(0, y, "Every comparison begins with the labels of the classifier alone:", "small",
             "start"),
        method(424, y - 17, "independent", 112),
    ]  # fmt: skip
    CHART.write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")
    print(f"wrote {CHART}")
