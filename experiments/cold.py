"""Trajectories of the COLD campaign, tracked in a building that was not learned from."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.paper.front_laser import (
    CLASSES,
    NAMES,
    PLACES,
    STEP_M,
    load_cold_folder,
    place_classes,
)
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.trajectories.trajectory import Trajectory

CELLS_KEPT = 0.2


def load_cold(
    data: Path, building: str, classes: Mapping[str, str], names: tuple[str, ...]
) -> tuple[list[LabelledMap], list[tuple[LabelledMap, Trajectory]]]:
    """The labelled maps of a building, and every run with the map that it was recorded in."""
    maps, runs = [], []
    for folder in sorted(data.glob(f"cold_{building}_*")):
        known, found = load_cold_folder(folder, classes, names)
        maps.append(known)
        runs += [(known, run) for run in found]
    return maps, runs


def thinned(known: LabelledMap) -> LabelledMap:
    """The map with a share of its labels, drawn at random: neighbouring cells look alike."""
    kept = np.random.default_rng(0).random(known.labels.shape) < CELLS_KEPT
    return replace(known, labels=np.where(kept, known.labels, -1).astype(np.int16))


def table(data: Path, classes: Mapping[str, str], names: tuple[str, ...]) -> list[str]:
    """A row per direction: accuracy alone, filtered, smoothed; recall per label when smoothed."""
    rows = []
    for source, target in (("saarbrucken", "freiburg"), ("freiburg", "saarbrucken")):
        maps, _ = load_cold(data, source, classes, names)
        _, runs = load_cold(data, target, classes, names)
        labeler = TrajectoryLabeler(names, n_runs=5000).fit([thinned(item) for item in maps])
        found: dict[str, list[np.ndarray]] = {"alone": [], "filter": [], "smooth": []}
        truths = []
        for known, run in runs:
            run = run.resampled(STEP_M)
            scores = labeler.scores(run, known_map=known.grid)
            truths.append(run.labels)
            found["alone"].append(scores.argmax(axis=1))
            for mode in ("filter", "smooth"):
                tool = labeler.with_options(method__mode=mode)
                found[mode].append(tool.infer(run, scores).labels)
        truth = np.concatenate([item for item in truths if item is not None])
        scored = {
            key: evaluate(truth, np.concatenate(parts), names) for key, parts in found.items()
        }
        rates = " | ".join(f"{100 * item.accuracy:.1f}" for item in scored.values())
        recalls = ", ".join(
            f"{name} {100 * recall:.0f}"
            for name in names
            if (recall := scored["smooth"].recall[name]) is not None
        )
        rows.append(
            f"| {source} to {target} | {len(names)} | {scored['alone'].n} | {rates} | {recalls} |"
        )
        print(rows[-1], flush=True)
    return rows


def cold_table(data: Path) -> str:
    """Three places and the categories, in both directions."""
    head = (
        "| buildings | labels | poses | single scans | filter | smoother | recall, smoothed |\n"
        "|---|---|---|---|---|---|---|"
    )
    rows = table(data, place_classes(), PLACES) + table(data, CLASSES, NAMES)
    return "\n".join([head, *rows])
