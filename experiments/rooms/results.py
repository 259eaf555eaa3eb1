"""Bormann et al.'s benchmark of room segmentation, on a folder of its maps.

R. Bormann, F. Jordan, W. Li, J. Hampp, M. Hägele: Room Segmentation: Survey, Implementation, and
Analysis. ICRA 2016.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.paper.section import Table
from experiments.rooms.maps import EMPTY, FURNISHED, RoomMap, read_room_maps
from experiments.rooms.scores import DoorCounts, RoomScores, score_doors, score_rooms
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelling.label import label_map
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.rules import TopologyOptions

PEERS = (
    ("Voronoi, Bormann et al.", FURNISHED, "86.6", "94.5", "ICRA 2016, table II"),
    ("ROSE², Luperto et al.", FURNISHED, "91.0", "93.5", "IEEE RA-L 7(3), 2022; arXiv 2203.03519"),
    ("Sharif, Mohan and Suvarna", FURNISHED, "94.1", "98.1", "arXiv 2303.13798, 2023"),
)
"""Published figures in percent: method, maps, recall, precision, source."""


@dataclass(frozen=True)
class RoomResult:
    """What was found on one map.

    Parameters
    ----------
    name, kind : str
    rooms : RoomScores
    doors : DoorCounts
    """

    name: str
    kind: str
    rooms: RoomScores
    doors: DoorCounts

    def to_dict(self) -> dict[str, Any]:
        """The figures as plain data."""
        return asdict(self)


def room_results(
    folder: Path,
    labeler: PlaceLabeler,
    rules: TopologyOptions,
    *,
    n_threads: int | None = None,
) -> Iterator[RoomResult]:
    """Each map of the benchmark, as soon as its rooms are found and scored.

    Found rooms are the places of the topological map, doorways apart.
    """
    for item in read_room_maps(folder):
        yield _result(item, labeler, rules, n_threads)


def _result(
    item: RoomMap, labeler: PlaceLabeler, rules: TopologyOptions, n_threads: int | None
) -> RoomResult:
    places = label_map(labeler, item.grid, n_threads=n_threads)
    topology = topological_map(
        item.grid,
        places.labels,
        places.label_names,
        rules=rules,
        correct=rules.correct,
        min_width_m=rules.min_width_m,
        doorways=places.doorways if rules.doorways == "gates" else None,
    )
    largest = max((region.id for region in topology.regions), default=0)
    number = np.full((2, largest + 1), -1, np.int32)  # of rooms, and of doorways, by id
    for region in topology.regions:
        row = number[int(region.label == rules.doorway_label)]
        row[region.id] = row.max() + 1
    return RoomResult(
        item.name,
        item.kind,
        score_rooms(item.rooms, number[0][topology.region]),
        score_doors(item.rooms, item.grid.free, number[1][topology.region], item.grid.resolution_m),
    )


def room_tables(results: Sequence[RoomResult]) -> tuple[Table, Table]:
    """Means and peers, and a row for each map."""
    means = [
        _mean_row([item for item in results if item.kind == kind], kind)
        for kind in (EMPTY, FURNISHED)
        if any(item.kind == kind for item in results)
    ]
    peers = [
        (name, kind, recall, precision, "-", "-", "-", source)
        for name, kind, recall, precision, source in PEERS
    ]
    heading = ("method", "maps", "recall", "precision", "F1", "doors found", "doors right")
    rows = tuple(
        (item.name, item.kind, *_percent(item), f"{item.rooms.n_found} of {item.rooms.n_true}")
        for item in results
    )
    return (
        Table(
            "Means over maps, in percent; doors over all maps; others as they published them",
            (*heading, "source"),
            (*means, *peers),
        ),
        Table("Each map, in percent", (heading[1], "kind", *heading[2:], "rooms"), rows),
    )


def _mean_row(results: Sequence[RoomResult], kind: str) -> tuple[str, ...]:
    scores = np.array([[r.rooms.recall, r.rooms.precision, r.rooms.f1] for r in results])
    doors = [r.doors for r in results]
    shares = (
        _share(sum(d.n_recalled for d in doors), sum(d.n_true for d in doors)),
        _share(sum(d.n_right for d in doors), sum(d.n_found for d in doors)),
    )
    means = (f"{100 * value:.1f}" for value in scores.mean(axis=0))
    return ("this package", f"{kind} ({len(results)})", *means, *shares, "this run")


def _percent(item: RoomResult) -> tuple[str, ...]:
    rooms, doors = item.rooms, item.doors
    figures = (f"{100 * value:.1f}" for value in (rooms.recall, rooms.precision, rooms.f1))
    return (
        *figures,
        _share(doors.n_recalled, doors.n_true),
        _share(doors.n_right, doors.n_found),
    )


def _share(part: int, total: int) -> str:
    return f"{100 * part / total:.1f}" if total else "-"
