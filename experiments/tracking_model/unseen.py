"""Drives in held-out buildings: single scans, filter and smoother, by building and by laser."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.array_cache import ArrayCache
from experiments.known_maps import NAMES
from experiments.tracking_model.drives import Observed
from experiments.tracking_model.learning import METHOD, N_FOLDS, Learned, Table, folds, learned
from experiments.tracking_model.real_drives import cold_drives, in_lobby, log_of_79
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.labelers.trajectory_labeler import METHOD as HMM
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.local_features import with_local_floor

WAYS = {
    "filter": (HMM, "filter"),
    "smoother": (HMM, "smooth"),
    "semi-Markov filter": (METHOD, "filter"),
    "semi-Markov smoother": (METHOD, "smooth"),
}
"""Methods and their modes, compared with single scans."""

ALONE = "single scans"
SHARE = 0.7
"""Weight of the networks relative to the list of scans, chosen in an earlier study."""

TOWNS = {"freiburg": "Freiburg 79", "saarbrucken": "Saarbrücken"}


class Answer(NamedTuple):
    """A drive, and its labels from single scans and from each mode of the model."""

    drive: Observed
    labels: Mapping[str, NDArray[np.int64]]


def answers(found: Learned, drives: Sequence[Observed]) -> Iterator[Answer]:
    """Held-out drives, labelled by a list and by methods that learned with it."""
    fitted = {id(method): found.labeler(method) for method in (HMM, METHOD)}
    labelers = {
        way: fitted[id(method)].with_options(method__mode=mode)
        for way, (method, mode) in WAYS.items()
    }
    both = FloorModel((), share=SHARE, doorway_share=SHARE)
    for drive in drives:
        scores = found.model.log_proba(drive.circles_m, spaces=drive.spaces)
        if drive.floor is not None:
            scores = with_local_floor(scores, drive.floor, both)
        labels = {ALONE: scores.argmax(axis=1)}
        for way, labeler in labelers.items():
            labels[way] = labeler.infer(drive.trajectory, scores).labels
        yield Answer(drive, labels)


def floor_answers(table: Table) -> Iterator[Answer]:
    """Every simulated drive, labelled by a model that saw no drive through its building."""
    fold = folds(table.drives)
    for number in range(N_FOLDS):
        found = learned(table.only(fold != number))
        print(f"fold {number}", flush=True)
        yield from answers(found, table.only(fold == number).drives)


def merged(
    some: Sequence[Answer],
    name: str,
    without: Callable[[Observed], NDArray[np.bool_]] | None = None,
) -> Evaluation:
    """The figures of one way of labelling over several drives."""
    parts = []
    for item in some:
        truth = item.drive.labels
        if without is not None:
            truth = np.where(without(item.drive), -1, truth)
        if (truth >= 0).any():
            parts.append(evaluate(truth, item.labels[name], NAMES))
    return Evaluation.merged(parts)


def figures(found: Evaluation) -> str:
    """Accuracy and balanced accuracy in percent."""
    return f"{100 * found.accuracy:.1f} / {100 * found.balanced_accuracy:.1f}"


HEAD = f"steps | {ALONE} | {' | '.join(WAYS)} |"
RULE = "|---" * (3 + len(WAYS)) + "|"


def _row(
    name: str,
    some: Sequence[Answer],
    without: Callable[[Observed], NDArray[np.bool_]] | None = None,
) -> str:
    scored = [merged(some, way, without) for way in (ALONE, *WAYS)]
    cells = [f"{figures(item)} ({100 * (item.recall['doorway'] or 0):.0f})" for item in scored]
    text = f"| {name} | {scored[0].n} | {' | '.join(cells)} |"
    print(text, flush=True)
    return text


def floors_table(found: Sequence[Answer]) -> str:
    """A row per kind of building and of map."""
    lines = [f"| drives simulated in | {HEAD}", RULE]
    groups = sorted({item.drive.group for item in found})
    lines += [
        _row(group, [item for item in found if item.drive.group == group]) for group in groups
    ]
    return "\n".join(lines)


REACHES = ((4.0, 8.0), (8.0, 20.0), (20.0, 80.0))
VIEWS = ((90.0, 90.0), (120.0, 180.0), (240.0, 270.0), (360.0, 360.0))
SPACINGS = ((0.2, 0.5), (0.5, 1.2), (1.2, 3.1))


def lasers_table(found: Sequence[Answer], way: str = "smoother") -> str:
    """By view: accuracy and balanced accuracy by reach, and by density."""
    head = [f"{low:g} to {high:g} m" for low, high in REACHES]
    head += [f"{low:g} to {high:g}°" for low, high in SPACINGS]
    lines = [f"| view | {' | '.join(head)} |", "|---" * (1 + len(head)) + "|"]
    for low, high in VIEWS:
        some = [item for item in found if low <= item.drive.laser.view_degrees <= high]
        name = f"{low:g}°" if low == high else f"{low:g}° to {high:g}°"
        lines.append(f"| {name} | {' | '.join(_by_laser(some, way))} |")
    return "\n".join(lines)


def _by_laser(some: Sequence[Answer], way: str) -> Iterator[str]:
    """The figures by reach, then by the angle between two beams; the number of drives of each."""
    reach = [item.drive.laser.reach_m for item in some]
    angle = [item.drive.laser.view_degrees / item.drive.laser.n_beams for item in some]
    for values, ranges in ((reach, REACHES), (angle, SPACINGS)):
        for low, high in ranges:
            chosen = [item for item, value in zip(some, values, strict=True) if low <= value < high]
            yield f"{figures(merged(chosen, way))} ({len(chosen)})" if chosen else "-"


def real_table(
    table: Table,
    data: Path,
    cache: ArrayCache,
    networks: Mapping[str, FloorModel] | None = None,
) -> str:
    """Drives of real robots: the COLD campaign with one town left out, and the log of building 79.

    Nothing of Freiburg's building 79, the campaign's building there, is learned from for either
    of the two; nothing of the campaign's other building for the rows of Saarbruecken. ``networks``
    are, for each building, the ones not trained on it.
    """
    lines = [f"| drives | {HEAD}", RULE]
    for town, building in TOWNS.items():
        floor = None if networks is None else networks[building]
        found = learned(table.only([item.building != building for item in table.drives]))
        some = list(answers(found, list(cold_drives(data, town, cache, floor))))
        lines.append(_row(f"COLD {building.split()[0]}, simulated front laser", some))
        if town == "saarbrucken":
            lines.append(_row("the same without the lobby", some, in_lobby))
            lines.append(_row("the lobby alone", some, lambda drive: ~in_lobby(drive)))
        else:
            log = list(answers(found, [log_of_79(data, cache, floor)]))
            lines.append(_row("log of building 79, real front laser", log))
    return "\n".join(lines)
