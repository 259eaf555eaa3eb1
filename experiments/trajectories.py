"""Trajectories on real buildings, labelled with and without a hidden Markov model.

``PGM_PLACES_DATA=DATA python -m experiments.trajectories`` prints their tables, or those that are
named; ``--write-docs`` renews them in docs/results.md. ``--kept FOLDER`` keeps there what each part
found, and each graph of the part ``graphs``, so that a run that was stopped goes on where it was.
"""

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.drives.kept_text import KeptText
from experiments.drives.methods import (
    CHAIN,
    JOINT,
    LOOPS,
    graphs_table,
    methods_table,
)
from experiments.map_prior import map_prior_table
from experiments.page_tables import SideBySide, parsed_tables, show_table, text_of, with_write_docs
from experiments.paper.categories import CATEGORY_NAMES, PLACES, Building79, load_building79
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.scan_model import BeamOptions

TABLES = (
    "beams",
    "methods",
    "prior",
    "graphs",
    "categories",
)
SHOWN: Mapping[str, tuple[SideBySide, ...]] = {
    "prior": (SideBySide(("method",), "weight {weight of the map}", "{right half}"),),
    "graphs": (
        SideBySide(("method",), "{drives}", f"{{{CHAIN}}}"),
        SideBySide(("method",), "{drives}: with loops", f"{{{LOOPS}}}"),
        SideBySide(("method",), "{drives}: with the cells", f"{{{JOINT}}}"),
    ),
}
"""How long tables are made short and wide."""

MODES = ("filter", "smooth", "viterbi")
HEAD = (
    "| beams | trained on | single scans | filter | smoother | Viterbi | "
    "doorway recall: alone / filter / smoother |\n|---|---|---|---|---|---|---|"
)
FRONT_ONLY = {"front only": BeamOptions("max-range")}
LOCAL = {"front, rear from the local map": BeamOptions()}
KNOWN = {"front, rear from the known map": BeamOptions("known-map")}
FROM_MAP: Mapping[str, BeamOptions] = {
    "front, its mirror image behind": BeamOptions("mirror"),
    **LOCAL,
    "all from the local map": BeamOptions(all_from_map=True),
    **KNOWN,
    "all from the known map": BeamOptions("known-map", all_from_map=True),
}


def answers(
    labeler: TrajectoryLabeler, path: Trajectory, scores: NDArray[np.float64]
) -> dict[str, NDArray[np.int64]]:
    """Labels from each scan alone and from each mode of the hidden Markov model."""
    found = {"alone": scores.argmax(axis=1)}
    for mode in MODES:
        found[mode] = labeler.with_options(method__mode=mode).infer(path, scores).labels
    return found


def row(
    name: str,
    learned_on: str,
    found: Mapping[str, NDArray[np.int64]],
    truth: NDArray[np.int64],
    names: Sequence[str],
) -> str:
    """A row of the table."""
    scored = {key: evaluate(truth, labels, names) for key, labels in found.items()}
    rates = " | ".join(f"{100 * item.accuracy:.1f}" for item in scored.values())
    doors = " / ".join(
        f"{100 * (scored[key].recall['doorway'] or 0.0):.0f}"
        for key in ("alone", "filter", "smooth")
    )
    text = f"| {name} | {learned_on} | {rates} | {doors} |"
    print(text, flush=True)
    return text


def places_table(data: Building79) -> str:
    """Three places: the left half is learned from, the right half of the log is labelled."""
    truth = np.where(data.left, -1, data.place)
    path = data.path
    left = path.with_labels(np.where(data.left, data.place, -1), PLACES)
    from_map = from_left_map(data)
    lines = [HEAD]
    for name, beams in FROM_MAP.items():
        labeler = from_map.with_options(beams=beams)
        found = answers(labeler, path, labeler.scores(path, known_map=data.map.grid))
        lines.append(row(name, "left map", found, truth, PLACES))
    for name, beams in {**FRONT_ONLY, **LOCAL}.items():
        labeler = TrajectoryLabeler(PLACES, beams=beams).fit([], [left])
        found = answers(labeler, path, labeler.scores(path))
        lines.append(row(name, "left log", found, truth, PLACES))
    both = TrajectoryLabeler(PLACES).fit([data.training_map], [left])
    found = answers(both, path, both.scores(path))
    lines.append(row(next(iter(LOCAL)), "left map and log", found, truth, PLACES))
    return "\n".join(lines)


def from_left_map(data: Building79) -> TrajectoryLabeler:
    """A labeler that knows the left half of the map, and no log."""
    return TrajectoryLabeler(PLACES).fit([data.training_map])


def categories_table(data: Building79) -> str:
    """Categories, learned from one half of the log and looked for in the other."""
    lines = [HEAD]
    for learn_left in (False, True):
        learn = data.left == learn_left
        learned = np.where(learn, data.category, -1)
        known = np.unique(learned[learned >= 0])
        names = tuple(CATEGORY_NAMES[k] for k in known)
        number = np.full(len(CATEGORY_NAMES) + 1, -1)  # its last entry is for "unknown", -1
        number[known] = np.arange(len(known))
        truth = np.where(learn, -1, number[data.category])
        path = data.path.with_labels(number[learned], names)
        for name, beams in {**FRONT_ONLY, **LOCAL, **KNOWN}.items():
            labeler = TrajectoryLabeler(names, beams=beams)
            labeler = labeler.fit([], [path], known_map=data.map.grid)
            found = answers(labeler, path, labeler.scores(path, known_map=data.map.grid))
            where = f"{'left' if learn_left else 'right'} log, {len(names)} categories"
            lines.append(row(name, where, found, truth, names))
    return "\n".join(lines)


def shown(part: str, text: str) -> str:
    """What the page shows of a part's table; a method that has no figures has no row."""
    if part not in SHOWN:
        return text
    [table] = parsed_tables(text)
    wide = [layout.of(table) for layout in SHOWN[part]]
    kept = [replace(item, rows=tuple(filter(_has_figures, item.rows))) for item in wide]
    return text_of([item for item in kept if item.rows])


def _has_figures(row: Sequence[str]) -> bool:
    return any(any(map(str.isdigit, cell)) for cell in row[1:])


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    found = with_write_docs(argparse.ArgumentParser(prog="python -m experiments.trajectories"))
    found.add_argument("--kept", type=Path, help="folder of what is slow to compute")
    found.add_argument(
        "parts", nargs="*", choices=[*TABLES, []], metavar="part", help=", ".join(TABLES)
    )
    return found


def main() -> None:
    """Run all parts, or those that are named, and write their tables."""
    chosen = parser().parse_args()
    data = os.environ.get("PGM_PLACES_DATA")
    if not data:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    building, kept = load_building79(Path(data)), KeptText(chosen.kept)
    parts: Mapping[str, Callable[[], str]] = {
        "beams": lambda: places_table(building),
        "methods": lambda: methods_table("building79.toml"),
        "prior": lambda: map_prior_table(building),
        "graphs": lambda: graphs_table(kept),
        "categories": lambda: categories_table(building),
    }
    for name in chosen.parts or TABLES:
        text = shown(name, kept.text(name, parts[name]))
        show_table(name, text, write=chosen.write_docs)


if __name__ == "__main__":
    main()
