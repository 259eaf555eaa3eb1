"""What the floor networks bring to drives: ``python -m experiments.tracking_model.networks``.

``PGM_PLACES_DATA=DATA python -m experiments.tracking_model.networks --kept FOLDER --networks KEPT``
simulates drives of 60 m in all labelled maps, keeps what they show in the folder, and prints
tables by kind of building: the list of scans alone, the network alone, and their mean, each
learned without the building. KEPT is the folder of ``python -m experiments.floor_network``.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.maps import GENERATED, NAMES, KnownMap, known_maps
from experiments.floor_network.floors import all_floors, fold_of, held_out_with
from experiments.floor_network.held_out import networks
from experiments.kept import KeptArrays, fingerprint
from experiments.paper.setting import data_folder
from experiments.tracking_model.drives import BEAMS, SENSOR, Laser, Observed
from experiments.tracking_model.learning import METHOD, N_FOLDS, Learned, Table, folds, learned
from experiments.tracking_model.unseen import ALONE, Answer, merged
from pgm_places._version import __version__
from pgm_places.sensing.simulated_robot import SimulatedRobot
from pgm_places.trajectories.segments import Segments
from pgm_places.unary.floor_model import FloorModel, with_local_floor
from pgm_places.unary.scan_model import observed_along

LENGTH_M, EVERY_M = 60.0, 0.5
SHARES = (0.0, 0.5, 0.7, 0.8, 0.9, 1.0)
"""Weights of the networks that are tried: 0 is the list alone, 1 the network alone."""

REAL = "real SLAM"

MODES = ("filter", "smooth")


@dataclass(frozen=True, eq=False)
class Seen:
    """A drive, and what the network that has not seen its building says at each step (n, K)."""

    drive: Observed
    floor: NDArray[np.float64]


def drives(
    data: Path, kept: KeptArrays, models: Sequence[FloorModel], every: int
) -> Iterator[Seen]:
    """A drive through every real map, and through the others of each ``every``-th building.

    Those through generated buildings are only learned from.
    """
    fold = fold_of(list(all_floors(data)))
    buildings: list[str] = []
    for number, known in enumerate(known_maps(data, kept)):
        name = str(known.item.building or known.item.name)
        if name not in buildings:
            buildings.append(name)
        if not known.group.endswith(REAL) and buildings.index(name) % every:
            continue
        generated = known.source == GENERATED
        model = None if generated else models[fold[held_out_with(known)]]
        found = _drive(known, number, kept, model)
        print(f"{number}: {known.item.name}, {len(found.drive.labels)} steps", flush=True)
        yield found


def _drive(known: KnownMap, number: int, kept: KeptArrays, model: FloorModel | None) -> Seen:
    laser = Laser.drawn(np.random.default_rng([number, 7]))

    def make() -> dict[str, NDArray[np.generic]]:
        robot = SimulatedRobot(
            laser.geometry, radius_m=0.2, speed_m_s=0.5, sensor_noise=laser.noise(number)
        )
        path = robot.explore(known.item.grid, max_length_m=LENGTH_M, seed=number)
        path = path.labelled_by(known.item, NAMES)
        assert path.labels is not None
        seen = observed_along(path, SENSOR, BEAMS, floor=model)
        steps = Segments(path.poses, EVERY_M).first
        steps = steps[path.labels[steps] >= 0]
        floor = np.empty((0, len(NAMES))) if seen.floor is None else seen.floor[steps]
        return {
            "poses": path.poses[steps],
            "labels": path.labels[steps],
            "circles": seen.circles_m[steps],
            "spaces": seen.spaces[steps],
            "floor": floor,
        }

    of_network = None if model is None else model.networks[0].packed()
    stem = fingerprint(
        __version__, number, laser, LENGTH_M, EVERY_M, known.item.grid.cells, of_network
    )
    found = kept.arrays(f"{stem}-seen", make)
    parts = (found[name] for name in ("poses", "labels", "circles", "spaces"))
    building = str(known.item.building or known.item.name)
    drive = Observed(
        known.item.name, building, known.group, laser, known.source == GENERATED, *parts
    )
    return Seen(drive, found["floor"])


def answers(found: Learned, some: Sequence[Seen], share: float) -> Iterator[Answer]:
    """What a list that has not seen them, with so much of the network, says of drives."""
    labelers = {mode: found.labeler(METHOD).with_options(method__mode=mode) for mode in MODES}
    for seen in some:
        drive = seen.drive
        scores = found.model.log_proba(drive.circles_m, spaces=drive.spaces)
        mixed = with_local_floor(
            scores, seen.floor, FloorModel((), share=share, doorway_share=share)
        )
        labels = {ALONE: mixed.argmax(axis=1)}
        labels |= {
            mode: labeler.infer(drive.trajectory, mixed).labels
            for mode, labeler in labelers.items()
        }
        yield Answer(drive, labels)


def held_out(all_seen: Sequence[Seen]) -> dict[float, list[Answer]]:
    """Every drive by each share, labelled without its building."""
    table = Table.of([seen.drive for seen in all_seen])
    fold = folds(table.drives)
    found: dict[float, list[Answer]] = {share: [] for share in SHARES}
    for number in range(N_FOLDS):
        model = learned(table.only(fold != number))
        some = [seen for seen, k in zip(all_seen, fold, strict=True) if k == number]
        for share, mine in found.items():
            mine += answers(model, some, share)
        print(f"fold {number}", flush=True)
    return found


def figures(some: Sequence[Answer], way: str) -> tuple[float, float, float]:
    """Accuracy, balanced accuracy and the recall of doorways, in percent."""
    found = merged(some, way)
    return (
        100 * found.accuracy,
        100 * found.balanced_accuracy,
        100 * (found.recall["doorway"] or 0.0),
    )


def tables(found: dict[float, list[Answer]], shown: float) -> str:
    """By kind: the list, the network, and both with the share that is shown; then all shares."""
    groups = sorted({item.drive.group for item in found[0.0]})
    columns = {"list": 0.0, "network": 1.0, "both": shown}
    head = [f"{way}: {name}" for way in (ALONE, *MODES) for name in columns]
    lines = [f"| drives simulated in | steps | {' | '.join(head)} |", "|---" * 11 + "|"]
    for group in groups:
        cells = []
        for way in (ALONE, *MODES):
            for share in columns.values():
                mine = [item for item in found[share] if item.drive.group == group]
                cells.append("{:.1f} / {:.1f} ({:.0f})".format(*figures(mine, way)))
        n = sum(len(item.drive.labels) for item in found[0.0] if item.drive.group == group)
        lines.append(f"| {group} | {n} | {' | '.join(cells)} |")
    lines += ["", f"| weight of the networks | {' | '.join((ALONE, *MODES))} |", "|---" * 4 + "|"]
    for share, mine in found.items():
        cells = []
        for way in (ALONE, *MODES):
            by_group = [
                figures([item for item in mine if item.drive.group == group], way)
                for group in groups
            ]
            cells.append("{:.1f} / {:.1f} ({:.0f})".format(*np.mean(by_group, axis=0)))
        lines.append(f"| {share:g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Simulate the drives and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m experiments.tracking_model.networks")
    parser.add_argument("--kept", type=Path, required=True, help="folder that keeps the drives")
    parser.add_argument("--networks", type=Path, required=True, help="folder of the networks")
    parser.add_argument(
        "--every",
        type=int,
        default=1,
        help="only drives of the real maps and of every n-th other building",
    )
    parser.add_argument("--share", type=float, default=0.9, help="share shown by kind")
    chosen = parser.parse_args()
    data = data_folder()
    if data is None:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    chosen.kept.mkdir(parents=True, exist_ok=True)
    models = [FloorModel((network,), views_per_network=1) for network in networks(chosen.networks)]
    seen = list(drives(data, KeptArrays(chosen.kept), models, chosen.every))
    print(tables(held_out(seen), chosen.share))


if __name__ == "__main__":
    main()
