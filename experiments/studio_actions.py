"""How many answers a map takes in the studio: ``python -m experiments.studio_actions``.

The person of :mod:`experiments.teaching`, on floors and on maps that robots made: places by doubt
times area, paint kept and not learned, as the studio does until it is told to teach. Writes a table
of docs/results.md. PGM_PLACES_DATA is the folder of the real maps.

``--strokes`` measures how long a correction takes to new labels.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np

from experiments.buildings.maps import WITH_HALLS, real_maps
from experiments.page_tables import with_write_docs, write_table
from experiments.teaching import CHOSEN_ON, FLOORS, NAMES, Course, by_teaching
from pgm_places import trained_labeler
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.teaching.teacher import Teacher

TABLES = ("answers",)

ROBOTS = (
    "arena_clf",
    "building_ecn",
    "corridor_atlas",
    "corridor_bigen",
    "corridor_uma",
    "hallway_mirs",
    "hallway_stmobo",
    "home_ex1",
    "hospital_pal",
    "institute_milan",
)
"""Ten buildings whose labels are sure, with rooms and circulation."""

STROKES_ON = "school_valleceppi_p0"


def floor(data: Path, name: str) -> LabelledMap:
    """A drawn floor by its name."""
    return next(known.item for known in real_maps(data) if known.item.name == name)


def robot_map(data: Path, name: str) -> LabelledMap:
    """A robot's map as it came."""
    folder = data / "robots" / name
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", WITH_HALLS.names, grid=grid)
    return WITH_HALLS.fold(LabelledMap(grid, labels, None, name))


def table(found: dict[str, Course]) -> str:
    """A row per map, and the median."""
    lines = [
        "| map | before | answers to 99 % (looks) | after each answer, % |",
        "|---|---|---|---|",
    ]
    for name, course in found.items():
        shares = [f"{100 * value:.1f}" for value in course.accuracy]
        number = course.clicks
        words = str(number) if number is not None else f"not after {len(shares) - 1}"
        answers = f"{words} ({course.looks})" if course.looks else words
        lines.append(f"| {name} | {shares[0]} % | {answers} | {', '.join(shares[1:]) or '-'} |")
    numbers = [np.inf if course.clicks is None else course.clicks for course in found.values()]
    more = sum(4 < number < np.inf for number in numbers)
    never = sum(number == np.inf for number in numbers)
    lines += [
        "",
        f"The median is {np.median(numbers):g}. More than four: {more} of {len(numbers)}; left "
        f"with crumbs of less than 0.05 m² before 99 %: {never}.",
    ]
    return "\n".join(lines)


def strokes(data: Path) -> None:
    """Processor seconds from a corrected room to new labels, with ``default`` on one thread."""
    grid = floor(data, STROKES_ON).grid
    teacher = Teacher(grid, trained_labeler(), n_threads=1)
    first = teacher.label(teacher.blank())
    paint = first.paint
    rooms = [check.place.id for check in first.checks if check.place.label == NAMES[1]][:4]
    for place in rooms:
        paint = paint.with_cells(first.topology.cells(place), NAMES[0])
        start = time.process_time()
        teacher.label(paint)
        print(f"{STROKES_ON}, {grid.shape}: {time.process_time() - start:.2f} s", flush=True)


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    found = with_write_docs(argparse.ArgumentParser(prog="python -m experiments.studio_actions"))
    found.add_argument("--strokes", action="store_true", help="only time a correction")
    return found


def main() -> None:
    """Simulate the person on all maps and write the table."""
    given = parser().parse_args()
    data = Path(os.environ["PGM_PLACES_DATA"])
    if given.strokes:
        strokes(data)
        return
    found = {}
    for name in (*FLOORS, *CHOSEN_ON, *ROBOTS):
        item = robot_map(data, name) if name in ROBOTS else floor(data, name)
        found[name] = by_teaching(item, "doubt", learns=False)
        print(table(found), flush=True)
    if given.write_docs:
        print(write_table("answers", table(found)))


if __name__ == "__main__":
    main()
