"""Kinds of rooms on drawn floors: ``PGM_PLACES_DATA=DATA python -m experiments.room_kinds``.

Places between the true doorways are labelled with one of nine kinds, by their features alone and
by fields over the graph of places that lie beside each other; every building is left out in turn.
The options of each method are chosen on the other buildings. Writes two tables of docs/results.md
and the picture of one floor.
"""

import argparse
import csv
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.page_tables import show_table, text_of, with_write_docs
from experiments.paper.section import Table
from pgm_places.evaluation.confusion import confusion_matrix
from pgm_places.inference.backends import build
from pgm_places.inference.problem import LabelingProblem
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.label_values import listed_names
from pgm_places.io.maps.map_server import load_map
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.place_neighbours import neighbour_graph
from pgm_places.spaces.places import Places, place_features, places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import PLACE_FEATURES

FOLDER = Path(__file__).resolve().parent
TABLES = ("room_kinds", "kinds")
PICTURE = FOLDER.parent / "docs" / "images" / "room_kinds.png"
SHOWN = "school_plans1"

SOURCES: Mapping[str, tuple[str, ...]] = {
    "class room": ("classroom", "lab"),
    "office": (
        *("office", "shared_office", "executive_office", "cubicule", "openspace"),
        *("small_administrative", "medium_administrative", "big_administrative"),
    ),
    "meeting room": ("conference_room",),
    "washroom": ("washroom", "bathroom"),
    "corridor": ("corridor",),
    "hall": ("hall", "lobby", "entrance", "reception"),
    "stairs": ("stairs", "elevator"),
    "storage": ("closet", "medium_service", "big_service", "convenience_store", "kitchen"),
    "large hall": ("gym", "conference", "conference_hall", "canteen", "cafeteria", "library"),
}
"""The kinds, and the names that the floors' plans have for them."""

KINDS = tuple(SOURCES)
COARSE = {"corridor": "circulation", "hall": "circulation", "stairs": "circulation"}
"""What the shipped models call a corridor, against rooms of every kind."""

LEAST_SHARE = 0.6
"""A place has a kind if so much of its labelled area is of that kind, else it is left unlabelled:
where no door parts two spaces, they are one place."""

N_TREES, N_FOLDS, MIN_PROBABILITY = 100, 3, 1e-3

METHODS: Mapping[str, tuple[str, dict[str, Any], str, tuple[Any, ...]]] = {
    "potts": ("potts", {}, "weight", (0.0, 0.1, 0.3, 1.0)),
    "amn": ("amn", {"node_features": "logz"}, "C", (100.0,)),
    "relaxation": ("relaxation", {"smoothing": 5.0}, "max_iterations", (1, 2, 3, 5)),
}
"""Backend, its fixed options, and the option that is chosen with its values."""


@dataclass(frozen=True, eq=False)
class Floor:
    """The places of a floor as a labelling problem.

    Parameters
    ----------
    name, building : str
    problem : LabelingProblem
        With features of the places, and after scoring the unary of a held-out classifier.
    truth : (P,) int64
        Kind of each place, -1 where it has none.
    area_m2 : (P,) float64
    grid : OccupancyGrid
    place : (H, W) int32
        Place of each cell, -1 for none.
    """

    name: str
    building: str
    problem: LabelingProblem
    truth: NDArray[np.int64]
    area_m2: NDArray[np.float64]
    grid: OccupancyGrid
    place: NDArray[np.int32]

    @property
    def is_school(self) -> bool:
        """Whether it is a floor of a school rather than of an office building."""
        return self.name.startswith("school")


def describe(places: Places) -> NDArray[np.float64]:
    """(P, 50) the features of places, and seven of their building, the same for all its places."""
    values = place_features(places)
    if not len(values):
        return np.zeros((0, values.shape[1] + 7))
    area, radius, gates = (
        values[:, [spec.id for spec in PLACE_FEATURES].index(name)]
        for name in ("area", "radius", "gates")
    )
    building = [len(values), area.sum(), np.median(area), np.exp(np.log(area).mean())]
    building += [np.average(area, weights=area), np.median(radius), gates.mean()]
    return np.column_stack([values, np.tile(building, (len(values), 1))])


def kinds_of_places(
    place: NDArray[np.int32], count: int, kind: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(P,) the kind of each place by the kinds of its cells, -1 where none prevails.

    ``kind`` (H, W) is -1 for cells that are unlabelled or doorways, and K for those of another
    kind than the K that are learned.
    """
    known = (place >= 0) & (kind >= 0)
    table = np.zeros((count, len(KINDS) + 1), np.int64)
    np.add.at(table, (place[known], kind[known]), 1)
    size = np.bincount(place[place >= 0], minlength=count)
    labelled, best = table.sum(axis=1), table[:, :-1].max(axis=1)
    clear = (best > 0) & (best >= LEAST_SHARE * labelled) & (2 * labelled >= size)
    return np.where(clear, table[:, :-1].argmax(axis=1), -1)


def load_floor(folder: Path, building: str) -> Floor:
    """A floor with its true doorways as gates."""
    grid = load_map(folder / "map.yaml").grid
    names = ("corridor", "room", "doorway")
    labels = load_labels(folder / "labels.png", names, grid=grid)
    gates = gate_candidates(Segmentation.of(grid))
    places = places_between(gates, match_doors(gates, labels, names.index("doorway")).is_doorway)
    fine_names = listed_names(folder / "fine.png", None)
    fine = load_labels(folder / "fine.png", fine_names, grid=grid)
    number = [_kind_of(name) for name in fine_names]
    kind = np.array([*number, -1])[fine]
    place = places.segments.raster()
    problem = LabelingProblem(neighbour_graph(places), KINDS, node_features=describe(places))
    truth = kinds_of_places(place, places.count, kind)
    return Floor(folder.name, building, problem, truth, places.segments.area_m2, grid, place)


def _kind_of(name: str) -> int:
    """The number of a plan's name for a space: -1 for doorways, K for other spaces."""
    if name == "doorway":
        return -1
    return next((k for k, kind in enumerate(KINDS) if name in SOURCES[kind]), len(KINDS))


def load_floors(data: Path) -> list[Floor]:
    """All floors, in the order of their index."""
    with (data / "floors" / "index.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [load_floor(data / "floors" / row["floor"], row["building"]) for row in rows]


def forest() -> Any:
    """The classifier of single places."""
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(N_TREES, min_samples_leaf=2, random_state=0)


def scored(floors: Sequence[Floor], learn_from: Sequence[Floor]) -> list[Floor]:
    """The floors with the log-probabilities of a forest that learned from others as unary."""
    features = np.concatenate([_features(item) for item in learn_from])
    truth = np.concatenate([item.truth for item in learn_from])
    fitted = forest().fit(features[truth >= 0], truth[truth >= 0])
    found = []
    for item in floors:
        table = np.full((len(item.truth), len(KINDS)), MIN_PROBABILITY)
        if len(table):
            sure = fitted.predict_proba(_features(item))
            table[:, fitted.classes_] = np.maximum(sure, MIN_PROBABILITY)
        unary = np.log(table / table.sum(axis=1, keepdims=True))
        found.append(replace(item, problem=replace(item.problem, unary=unary)))
    return found


def _features(item: Floor) -> NDArray[np.float64]:
    assert item.problem.node_features is not None  # load_floor gave them
    return item.problem.node_features


def held_out(floors: Sequence[Floor]) -> list[Floor]:
    """The floors scored by forests that have seen no floor of their building, in some folds."""
    buildings = sorted({item.building for item in floors})
    fold = {name: k % N_FOLDS for k, name in enumerate(buildings)}
    found: dict[str, Floor] = {}
    for k in range(min(N_FOLDS, len(buildings))):
        out = [item for item in floors if fold[item.building] == k]
        rest = [item for item in floors if fold[item.building] != k]
        found |= {item.name: item for item in scored(out, rest)}
    return [found[item.name] for item in floors]


def chosen(name: str, floors: Sequence[Floor]) -> StructuredLabeler:
    """A method fitted on scored floors, its option chosen by cross-validation over buildings."""
    from sklearn.model_selection import GridSearchCV, GroupKFold

    backend, fixed, option, values = METHODS[name]
    problems, truths = [item.problem for item in floors], [item.truth for item in floors]
    if len(values) == 1:
        return StructuredLabeler(build(backend, {**fixed, option: values[0]})).fit(problems, truths)
    search = GridSearchCV(
        StructuredLabeler(build(backend, fixed), metric="accuracy"),
        {f"backend__{option}": list(values)},
        cv=GroupKFold(min(N_FOLDS, len({item.building for item in floors}))),
    )
    groups = [item.building for item in floors]
    search.fit(problems, truths, groups=groups)
    best: StructuredLabeler = search.best_estimator_
    return best


def leave_out(floors: Sequence[Floor], building: str) -> dict[str, dict[str, NDArray[np.int64]]]:
    """By method and floor, the labels of a building's places from all other buildings."""
    rest = [item for item in floors if item.building != building]
    tests = scored([item for item in floors if item.building == building], rest)
    training = held_out(rest)
    found = {"independent": {item.name: unary(item).argmax(axis=1) for item in tests}}
    for name in METHODS:
        labeler = chosen(name, training)
        found[name] = {item.name: labeler.label(item.problem).labels for item in tests}
    print(building, flush=True)
    return found


def unary(item: Floor) -> NDArray[np.float64]:
    """(P, K) the log-probabilities that ``scored`` gave the places of a floor."""
    assert item.problem.unary is not None
    return item.problem.unary


def leave_one_out(
    floors: Sequence[Floor], run: Callable[..., Iterable[Any]] = map
) -> dict[str, list[NDArray[np.int64]]]:
    """By method, the labels of each floor's places from all other buildings.

    ``run`` is ``map``, or that of several processes.
    """
    buildings = list(dict.fromkeys(item.building for item in floors))
    parts = list(run(partial(leave_out, floors), buildings))
    return {
        method: [
            next(p[method][item.name] for p in parts if item.name in p[method]) for item in floors
        ]
        for method in ("independent", *METHODS)
    }


# ---------------------------------------------------------------------- tables


def confusion(floors: Sequence[Floor], labels: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """(K, K) places of a kind (rows) labelled as a kind (columns), of all floors together."""
    if not floors:
        return np.zeros((len(KINDS), len(KINDS)), np.int64)
    truth = np.concatenate([item.truth for item in floors])
    return confusion_matrix(truth[truth >= 0], np.concatenate(labels)[truth >= 0], len(KINDS))


def figures(floors: Sequence[Floor], labels: Sequence[NDArray[np.int64]]) -> str:
    """Percentages of places, of area, the mean of the kinds, and places as circulation or room."""
    truth, found = np.concatenate([f.truth for f in floors]), np.concatenate(labels)
    known = truth >= 0
    right, area = (truth == found)[known], np.concatenate([f.area_m2 for f in floors])[known]
    recalls = [right[truth[known] == k].mean() for k in np.unique(truth[known])]
    passes = np.array([COARSE.get(kind, "room") == "circulation" for kind in KINDS])
    coarse = passes[truth[known]] == passes[found[known]]
    values = (right.mean(), np.average(right, weights=area), np.mean(recalls), coarse.mean())
    return " / ".join(f"{100 * value:.1f}" for value in values)


def method_table(floors: Sequence[Floor], labels: Mapping[str, list[NDArray[np.int64]]]) -> str:
    """A row per method: figures of all floors, of schools and of offices."""
    lines = ["| method | all | schools | offices |", "|---|---|---|---|"]
    for name, found in labels.items():
        cells = []
        for wanted in ((True, False), (True,), (False,)):
            some = [k for k, item in enumerate(floors) if item.is_school in wanted]
            cells.append(figures([floors[k] for k in some], [found[k] for k in some]))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def confusion_of(
    floors: Sequence[Floor], labels: Sequence[NDArray[np.int64]], *, school: bool
) -> NDArray[np.int64]:
    """(K, K) places of each kind in schools, or in offices, by what they were labelled as."""
    some = [k for k, item in enumerate(floors) if item.is_school == school]
    return confusion([floors[k] for k in some], [labels[k] for k in some])


def kinds_table(tables: Mapping[str, NDArray[np.int64]]) -> Table:
    """Places of each kind, recall and precision, and the two kinds it is most often taken for."""
    columns = ("places", "recall / precision", "taken for")
    heading = [f"{name}: {column}" for name in tables for column in columns]
    rows = [
        (kind, *(cell for table in tables.values() for cell in _of_kind(table, k)))
        for k, kind in enumerate(KINDS)
    ]
    return Table("", ("true kind", *heading), tuple(rows))


def _of_kind(table: NDArray[np.int64], k: int) -> tuple[str, str, str]:
    shares = [_percent(table[k, k], total) for total in (table[k].sum(), table[:, k].sum())]
    others = [j for j in np.argsort(-table[k], kind="stable") if j != k and table[k, j]][:2]
    taken = ", ".join(f"{KINDS[j]} {table[k, j]}" for j in others)
    return str(table[k].sum()), " / ".join(shares), taken or "-"


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.0f}" if whole else "–"


# ---------------------------------------------------------------------- picture


def picture(item: Floor, labels: Mapping[str, NDArray[np.int64]]) -> bytes:
    """A PNG file: the floor's places coloured by kind, true and as labelled, side by side."""
    import io

    import matplotlib.pyplot as plt
    from matplotlib.colors import ListedColormap, to_rgb
    from matplotlib.patches import Patch

    from pgm_places.palette import WALL

    colours = np.array([to_rgb(colour) for colour in _COLOURS] + [to_rgb("#e4e4e4")])
    rows, columns = np.nonzero(item.place >= 0)
    window = (slice(rows.min() - 4, rows.max() + 5), slice(columns.min() - 4, columns.max() + 5))
    high, wide = item.place[window].shape
    figure, axes = plt.subplots(
        1, len(labels), figsize=(5.2 * len(labels), 5.2 * high / wide + 1.1), layout="constrained"
    )
    for axis, (title, kinds) in zip(axes, labels.items(), strict=True):
        axis.imshow(
            np.ma.masked_where(~item.grid.occupied, item.grid.occupied)[window],
            cmap=ListedColormap([WALL]),
            origin="lower",
            interpolation="nearest",
        )
        shown = np.append(kinds, -1)[item.place]
        image = np.ones((*item.place.shape, 4))
        image[..., :3] = colours[shown]
        image[..., 3] = item.place >= 0
        axis.imshow(image[window], origin="lower", interpolation="nearest")
        axis.set_title(title, fontsize=11, loc="left")
        axis.set_axis_off()
    present = np.unique(np.concatenate([kinds[kinds >= 0] for kinds in labels.values()]))
    handles = [Patch(color=_COLOURS[k], label=KINDS[k]) for k in present]
    handles.append(Patch(color=colours[-1], label="no kind"))
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False, fontsize=10)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


_COLOURS = (
    *("#e69f00", "#0072b2", "#7b4fa3", "#56b4e9", "#f5dfb3"),
    *("#d8b98a", "#8c8c8c", "#cc79a7", "#009e73"),
)
"""One for each kind."""


def show(
    floors: Sequence[Floor], labels: Mapping[str, list[NDArray[np.int64]]], *, write_docs: bool
) -> None:
    """Print the tables of docs/results.md; if asked to, renew them and their picture."""
    truth = np.concatenate([item.truth for item in floors])
    area = np.concatenate([item.area_m2 for item in floors])
    print(
        f"{(truth >= 0).sum():,} of {len(truth):,} places, with "
        f"{100 * area[truth >= 0].sum() / area.sum():.0f} % of their area"
    )
    alone = labels["independent"]
    by_kind = kinds_table(
        {
            "schools": confusion_of(floors, alone, school=True),
            "offices": confusion_of(floors, alone, school=False),
        }
    )
    written = {"room_kinds": method_table(floors, labels), "kinds": text_of([by_kind])}
    for name in TABLES:
        show_table(name, written[name], write=write_docs)
    if not write_docs:
        return
    [at] = [k for k, item in enumerate(floors) if item.name == SHOWN]
    drawn = {"true kinds": floors[at].truth, "each place alone": labels["independent"][at]}
    drawn["with its neighbours (relaxation)"] = labels["relaxation"][at]
    PICTURE.write_bytes(picture(floors[at], drawn))


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    return with_write_docs(argparse.ArgumentParser(prog="python -m experiments.room_kinds"))


def main() -> None:
    """Run everything."""
    given = parser().parse_args()
    data = os.environ.get("PGM_PLACES_DATA")
    if not data:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    floors = load_floors(Path(data))
    with ProcessPoolExecutor(2) as pool:
        labels = leave_one_out(floors, pool.map)
    show(floors, labels, write_docs=given.write_docs)


if __name__ == "__main__":
    main()
