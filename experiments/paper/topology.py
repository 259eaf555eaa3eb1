"""Section 7.3: places, doors and connections of a labelled map, compared with the truth."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.paper.comparison_pictures import label_sheet, window_grid
from experiments.paper.region_scores import RegionScores, fill_labels, score_regions
from experiments.paper.section import Finding, Outcome, Picture, Table
from experiments.paper.setting import WAYS, Setting
from pgm_places.experiment.evaluated_items import TestItem
from pgm_places.experiment.runs import compare_fitted, train
from pgm_places.experiment.sources import load_maps
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.spaces.doorways import Doorways
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.topological_map import TopologicalMap

VARIANTS: Mapping[str, Mapping[str, Any]] = {"none": {"correct": False}, "the paper's": {}}

TRUTH = "ground truth"
PAPER = "one missed"

HEADING = (
    "method",
    "corrections",
    "rooms found / merged / missed / invented",
    "doorways found / missed / invented",
    "connections found / missed / invented",
    "purity",
)


def run(setting: Setting) -> Outcome:
    """The topological maps of all methods, with and without corrections and gates."""
    findings, pictures, tables, files = [], [], [], {}
    for way, preset in WAYS.items():
        experiment = setting.experiment("topology", preset=preset)
        tests = load_maps(experiment, "test")
        trained = train(experiment)
        comparison = compare_fitted(trained, tests)
        space = trained.labeler.unary_model_.space
        item, names = comparison.maps[0], comparison.label_names
        doorways = None if space is None else space.spaces(item.grid).doorways
        answers = {
            method.id: item.layout.to_raster(method.labelings[0].labels.astype(np.int16), fill=-1)
            for method in comparison.methods
        }
        with setting.progress.stage("topological maps"):
            table, maps, scores = topology_table(item, answers, names, doorways)
        tables.append(replace(table, caption=f"{way}: {table.caption}"))
        findings += [
            _doorways(method, name, counted, way)
            for (method, name), counted in scores.items()
            if name != "none"
        ]
        stem = way.replace(" ", "_")
        files[f"labels_{stem}.png"] = label_sheet(comparison)
        pictures.append(
            Picture(f"labels_{stem}.png", f"What the topological maps are made from, {way}.")
        )
        grid = window_grid(item.grid, item.window)
        for method, places in maps.items():
            name = f"topology_{stem}_{method.replace(' ', '_')}.png"
            files[name] = topology_drawing(grid, places).png()
            caption = f"Topological map from {method}, {way} (compare the paper's Fig. 9)."
            pictures.append(Picture(name, caption))
    return Outcome(
        setting=f"{100 * item.grid.resolution_m:g} cm cells; trained on the left half; "
        "regions, doors and connections of the right half, compared with those of the ground "
        "truth.",
        findings=tuple(findings),
        tables=tuple(tables),
        pictures=tuple(pictures),
        files=files,
        remarks=(
            "A true doorway is found if a predicted one covers a tenth of it; a room or a corridor "
            "if a predicted one covers most of it and of no other. Gaps of up to 0.3 m between the "
            "labels of the ground truth are filled first, and its specks are dropped by the "
            "same rules.",
        ),
    )


def topology_table(
    item: TestItem,
    answers: Mapping[str, NDArray[np.int16]],
    names: tuple[str, ...],
    doorways: Doorways | None = None,
) -> tuple[Table, dict[str, TopologicalMap], dict[tuple[str, str], RegionScores]]:
    """The table of one test map, the maps with most corrections, and all scores.

    Parameters
    ----------
    item : EvalMap
    answers : mapping of str to (H, W) int16
        Each method's labels, -1 for none.
    names : tuple of str
    doorways : Doorways, optional
        The accepted gates of the map, for one more row of each method.
    """
    inside = np.where(item.window, fill_labels(item.grid, item.truth, names), np.int16(-1))
    true_map = topological_map(item.grid, inside, names)
    maps, rows, scores = {TRUTH: true_map}, [], {}
    for method, raster in answers.items():
        labels = np.where(item.window, raster, np.int16(-1))
        variants = VARIANTS if doorways is None else {**VARIANTS, "gates": {"doorways": doorways}}
        for name, options in variants.items():
            places = topological_map(item.grid, labels, names, **options)
            words = f"{name}: {len(places.corrections)}" if places.corrections else name
            scores[method, name] = score_regions(places, true_map)
            rows.append(_row(method, words, scores[method, name]))
            maps[method] = places  # the last has most corrections, or the gates
    caption = f"{item.name}: places and connections found, compared with the ground truth"
    return Table(caption, HEADING, tuple(rows)), maps, scores


def _doorways(method: str, corrections: str, scores: RegionScores, way: str) -> Finding:
    door = scores.classes["doorway"]
    how = "gates" if corrections == "gates" else f"{corrections} corrections"
    return Finding(
        f"doorways found / missed / invented, {method}, {how}",
        paper=PAPER if (method, corrections) == ("relaxation", "the paper's") else None,
        counts=f"{door.hit} of {door.n_true} / {door.missed} / {door.invented}",
        way=way,
    )


def _row(method: str, corrections: str, scores: RegionScores) -> tuple[str, ...]:
    room, door = scores.classes["room"], scores.classes["doorway"]
    return (
        method,
        corrections,
        f"{room.hit} of {room.n_true} / {room.merged} / {room.missed} / {room.invented}",
        f"{door.hit} of {door.n_true} / {door.missed} / {door.invented}",
        f"{scores.connections_hit} of {scores.connections_true} / {scores.connections_missed} / "
        f"{scores.connections_invented}",
        f"{100 * scores.purity:.1f} %",
    )
