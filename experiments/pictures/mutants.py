"""The picture of mutation testing: how many changes the tests noticed, as the page's table says."""

import re

from experiments.pictures.kept import IMAGES, figure, graph_paper, keep
from pgm_places.palette import LABEL_COLOURS
from pgm_places.pictures.drawing import INK

ROW = re.compile(r"^\| (\w+, (?:plain Python|kernels)) \| \d+ \| (\d+) \| (\d+) \|", re.MULTILINE)
NOTICED, MISSED = LABEL_COLOURS[1], "#d5dae1"


def mutation_testing() -> None:
    """A bar for each folder: changes that were tried, and those that a test noticed."""
    page = (IMAGES.parent / "mutation_testing.md").read_text(encoding="utf-8")
    rows = [(name, int(tried), int(noticed)) for name, tried, noticed in ROW.findall(page)]
    rows.sort(key=lambda row: row[2] / row[1])
    picture = figure(9, 3.0)
    axis = picture.subplots()
    for place, (_, tried, noticed) in enumerate(rows):
        axis.barh(place, tried, color=MISSED, height=0.66, label="tried" if not place else None)
        axis.barh(place, noticed, color=NOTICED, height=0.66, label="noticed" if not place else "")
        axis.text(tried + 1, place, f"{100 * noticed / tried:.0f} %", va="center", fontsize=10,
                  color=INK)  # fmt: skip
    graph_paper(axis)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    axis.set_yticks(range(len(rows)), [name for name, *_ in rows], color=INK)
    axis.set_xticks([])
    axis.tick_params(length=0)
    axis.legend(frameon=False, fontsize=10, loc="lower right")
    keep("mutation_testing", picture)
