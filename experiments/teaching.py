"""How many clicks a map takes: ``PGM_PLACES_DATA=DATA python -m experiments.teaching``.

The truth stands in for a person who corrects one region or doorway with each click, until 99 % of
the labelled area is right. The labeler is the shipped model ``generated``, which has seen no real
building. The person goes through the places by doubt times area, or in random order, while the
labeler learns; or paints by hand, always the largest error first, over the labeler's result or on a
blank map. Writes a table of docs/results.md, and its figure.

``--choose`` compares how much is kept of what the labeler knew, on two other floors.
"""

import argparse
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.buildings.maps import real_maps
from experiments.page_tables import with_write_docs, write_table
from pgm_places import trained_labeler
from pgm_places.maps.components import Components, connected_components
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.teaching.lesson import TeachingOptions
from pgm_places.teaching.taught import Taught
from pgm_places.teaching.teacher import Teacher

FOLDER = Path(__file__).resolve().parent
TABLES = ("clicks",)
PICTURE = FOLDER.parent / "docs" / "images" / "teaching_clicks.png"

NAMES = ("corridor", "room", "doorway")
ENOUGH, MOST_CLICKS = 0.99, 30
SMALLEST_M2 = 0.05
"""Errors smaller than this are nothing that a person would click on."""

FLOORS = (
    "school_borchen4",
    "office_off_2",
    "school_varzeapaulistafde2",
    "office_130604_floor_plan_with_furni",
    "school_valleceppi_p0",
)
"""The smallest floors of five buildings, apart from those that options were chosen on."""

CHOSEN_ON = ("school_lamuniere1", "office_atlanticsuites")
KEEPS = (1.0, 30.0, 1000.0)

SEEN = 0.9
"""A place is not shown again if so much of it has been looked at with the labels that it has."""


@dataclass(frozen=True)
class Course:
    """What a person saw after each click.

    Parameters
    ----------
    accuracy : tuple of float
        Share of the labelled area that is right: before the first click, after each.
    looks : int
        Places that were looked at, right ones among them.
    """

    accuracy: tuple[float, ...]
    looks: int = 0

    @property
    def clicks(self) -> int | None:
        """How many it took; None if it was not enough."""
        return next((k for k, value in enumerate(self.accuracy) if value >= ENOUGH), None)


@dataclass(eq=False)
class Person:
    """Knows the truth, and corrects a region or a doorway of it with each click."""

    truth: NDArray[np.int16]
    cell_m2: float

    def __post_init__(self) -> None:
        self.regions: Components = connected_components(self.truth)
        self.known = self.truth >= 0

    def accuracy(self, labels: NDArray[np.int16]) -> float:
        """The share of the labelled area that is right."""
        return float((labels == self.truth)[self.known].mean())

    def correction(
        self, labels: NDArray[np.int16], where: NDArray[np.bool_] | None = None
    ) -> NDArray[np.bool_] | None:
        """The true region with most of the wrong cells (in a place); None if hardly any."""
        wrong = self.known & (labels != self.truth)
        if where is not None:
            wrong &= where
        counts = np.bincount(self.regions.piece[wrong], minlength=self.regions.count)
        if not counts.size or counts.max() * self.cell_m2 < SMALLEST_M2:
            return None
        return np.asarray(self.regions.piece == counts.argmax())


def by_teaching(
    item: LabelledMap,
    order: str,
    options: TeachingOptions | None = None,
    *,
    learns: bool = True,
) -> Course:
    """A person who goes through the places while the labeler learns, or only keeps the paint."""
    person = Person(np.where(item.cells, item.labels, -1), item.grid.resolution_m**2)
    teacher = Teacher(item.grid, trained_labeler("generated"), options=options)
    rng, shown = np.random.default_rng(0), np.full(item.grid.shape, -2, np.int16)
    paint, looks = teacher.blank(), 0
    taught = teacher.label(paint)
    course = [person.accuracy(taught.labels)]
    while course[-1] < ENOUGH and len(course) <= MOST_CLICKS:
        click = None
        for place in _places(taught, order, rng):
            inside = taught.topology.region == place
            if (shown == taught.labels)[inside].mean() >= SEEN:
                continue
            looks += 1
            click = person.correction(taught.labels, inside)
            if click is not None:
                break
            np.copyto(shown, taught.labels, where=inside)
        if click is None:  # every place has been looked at: only crumbs are left
            break
        name = NAMES[int(person.truth[click][0])]
        paint = paint.with_cells(np.argwhere(click), name)
        np.copyto(shown, person.truth, where=click)
        taught = teacher.teach(paint) if learns else teacher.label(paint)
        course.append(person.accuracy(taught.labels))
    return Course(tuple(course), looks)


def _places(taught: Taught, order: str, rng: np.random.Generator) -> Iterator[int]:
    """Ids of the places in the order in which they are shown."""
    ids = [check.place.id for check in taught.checks]
    yield from ids if order == "doubt" else rng.permutation(ids).tolist()


def by_hand(item: LabelledMap, labels: NDArray[np.int16]) -> Course:
    """A person who paints over labels, the largest error first, and nobody learns."""
    person = Person(np.where(item.cells, item.labels, -1), item.grid.resolution_m**2)
    labels, course = labels.copy(), []
    while True:
        course.append(person.accuracy(labels))
        click = person.correction(labels)
        if course[-1] >= ENOUGH or click is None:
            return Course(tuple(course))
        labels[click] = person.truth[click]


WAYS = ("doubt", "random", "pinned", "hand", "blank")
TITLES = {
    "doubt": "teaching, by doubt times area",
    "random": "teaching, random order",
    "pinned": "corrections kept, nothing learned, by doubt times area",
    "hand": "by hand over the model's labels, largest error first",
    "blank": "by hand on a blank map, largest region first",
}
COLOURS = {
    "doubt": "#1f5fa8",
    "random": "#c77d0a",
    "pinned": "#a6336c",
    "hand": "#4d8a3d",
    "blank": "#8a8a8a",
}


def courses(item: LabelledMap) -> dict[str, Course]:
    """All ways to label a map."""
    plain = Teacher(item.grid, trained_labeler("generated"))
    labels = plain.label(plain.blank()).labels
    return {
        "doubt": by_teaching(item, "doubt"),
        "random": by_teaching(item, "random"),
        "pinned": by_teaching(item, "doubt", learns=False),
        "hand": by_hand(item, labels),
        "blank": by_hand(item, np.full(item.grid.shape, -1, np.int16)),
    }


def table(found: dict[str, dict[str, Course]]) -> str:
    """A row per map."""
    lines = [
        "| map | before | teaching by doubt: clicks (looks) | random order: clicks (looks) | "
        "kept, not learned: clicks (looks) | by hand over the model | by hand from nothing |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, ways in found.items():
        cells = [name, f"{100 * ways['doubt'].accuracy[0]:.1f} %"]
        for way in WAYS:
            course = ways[way]
            text = f"{100 * course.accuracy[-1]:.1f} % after {len(course.accuracy) - 1}"
            text = text if course.clicks is None else str(course.clicks)
            cells.append(f"{text} ({course.looks})" if course.looks else text)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(found: dict[str, dict[str, Course]]) -> bytes:
    """Accuracy over clicks, a panel per map."""
    n_columns = 4
    n_rows = -(-len(found) // n_columns)
    figure = Figure(figsize=(3.0 * n_columns, 2.5 * n_rows), dpi=120, facecolor="white")
    axes = figure.subplots(n_rows, n_columns, sharey=True, squeeze=False).ravel()
    for axis, (name, ways) in zip(axes, found.items(), strict=False):
        for way in WAYS:
            values = 100 * np.array(ways[way].accuracy)
            axis.plot(np.arange(len(values)), values, color=COLOURS[way], label=TITLES[way], lw=1.6)
        axis.axhline(100 * ENOUGH, color="#b0b0b0", lw=0.8, ls=":")
        axis.set_title(name, fontsize=9, loc="left")
        axis.set_xlabel("clicks", fontsize=8)
        axis.tick_params(labelsize=8)
        axis.set_ylim(85, 100.3)
        axis.set_xlim(0, 30)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[len(found) :]:
        axis.axis("off")
    axes[0].set_ylabel("% of the area right", fontsize=8)
    handles, texts = axes[0].get_legend_handles_labels()
    spare = axes[-1] if len(found) < len(axes) else axes[0]
    spare.legend(handles, texts, loc="center", fontsize=8, frameon=False)
    figure.tight_layout()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def maps(data: Path, names: Sequence[str]) -> list[LabelledMap]:
    """Real maps by name, in that order."""
    wanted = {known.item.name: known.item for known in real_maps(data) if known.item.name in names}
    return [wanted[name] for name in names]


def choose(data: Path) -> None:
    """Compare how much is kept, on floors that no result is given for."""
    for item in maps(data, CHOSEN_ON):
        for keep in KEEPS:
            course = by_teaching(item, "doubt", TeachingOptions(keep=keep))
            shares = ", ".join(f"{100 * value:.2f}" for value in course.accuracy)
            print(f"{item.name} keep {keep:g}: {course.looks} looks; {shares}", flush=True)


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    found = with_write_docs(argparse.ArgumentParser(prog="python -m experiments.teaching"))
    found.add_argument("--choose", action="store_true", help="only compare how much is kept")
    return found


def main() -> None:
    """Simulate all ways on all maps and write the table and the figure."""
    given = parser().parse_args()
    data = Path(os.environ["PGM_PLACES_DATA"])
    if given.choose:
        choose(data)
        return
    found = {}
    for item in maps(data, ("building 79", "building 52", *FLOORS)):
        found[item.name] = courses(item)
        print(table(found), flush=True)
    if given.write_docs:
        PICTURE.write_bytes(draw(found))
        print(write_table("clicks", table(found)))


if __name__ == "__main__":
    main()
