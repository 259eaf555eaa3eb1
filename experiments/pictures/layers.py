"""The diagram of the layers: drawn from the contract that import-linter checks."""

import ast
import tomllib
from html import escape
from pathlib import Path

from experiments.pictures.svg import arrow, box, svg, text, write

ROOT = Path(__file__).resolve().parents[2]

BANDS = {
    "__main__": "commands",
    "report": "experiments",
    "trained": "labelers and files",
    "unary": "maps, drives, models",
    "solvers": "theory, on arrays",
    "plugins": "foundations",
}
"""From the layer of the first name down to the next band."""

WIDTH, LEFT, RIGHT = 880, 190, 790
STEP, BOX, MARGIN, GAP = 36, 28, 9, 12
CHARACTER, PADDING = 8.0, 26


def layers() -> list[list[str]]:
    """The names of each layer, the highest first."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    rows = next(item["layers"] for item in contracts if item["type"] == "layers")
    return [row.split(" | ") for row in rows]


def first_line(name: str) -> str:
    """What a module or folder says of itself."""
    path = ROOT / "pgm_places" / name
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n")[0]


def row(y: float, names: list[str]) -> list[str]:
    """The boxes of a layer side by side; a pointer over one shows its first line."""
    widths = [CHARACTER * len(name) + PADDING for name in names]
    x = (LEFT + RIGHT - sum(widths) - GAP * (len(names) - 1)) / 2
    parts = []
    for name, width in zip(names, widths, strict=True):
        parts += [
            f"<g><title>{escape(first_line(name))}</title>",
            f'<g class="front">{box(x, y, width, BOX, 6)}</g>',
            text(x + width / 2, y + BOX / 2, name, "code"),
            "</g>",
        ]
        x += width + GAP
    return parts


def bands() -> dict[str, list[list[str]]]:
    """The layers of each band."""
    found: dict[str, list[list[str]]] = {}
    for names in layers():
        if names[0] in BANDS:
            found[BANDS[names[0]]] = []
        found[list(found)[-1]].append(names)
    return found


def drawn() -> str:
    """The diagram."""
    parts, y = [], 2.0
    for title, rows in bands().items():
        height = STEP * len(rows) + BOX - STEP + 2 * MARGIN
        parts += [box(1, y, RIGHT + 20, height), text(18, y + height / 2, title, "head", "start")]
        for number, names in enumerate(rows):
            parts += row(y + MARGIN + number * STEP, names)
        y += height + GAP
    parts += [arrow((848, 40), (848, y - 40)), text(848, 20, "imports", "small")]
    title = "The layers of the package: a folder imports only from the rows below its own"
    return svg(WIDTH, y, title, parts)


def write_layers() -> None:
    """Keep the diagram."""
    write("layers", drawn())
