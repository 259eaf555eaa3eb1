"""Buildings left out: how well models transfer to new buildings, by kind of building, and why."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.lists import RECIPES, WHOLE, scored_maps
from experiments.buildings.maps import (
    EXAMPLES_PER_MAP,
    GENERATED,
    LATTICE_STEP,
    NAMES,
    building_numbers,
    sampled_maps,
)
from experiments.buildings.scores import (
    AVERAGED,
    GATES,
    POTTS,
    RESCALED,
    SHIPPED,
    TEMPERED,
    MapResult,
    map_results,
    means,
)
from experiments.paper.figures import percent
from experiments.paper.section import Finding, Outcome, Picture, Table
from experiments.paper.setting import Setting
from pgm_places.palette import ERROR, GROUND_SWATCHES, Swatch, label_swatches
from pgm_places.pictures.canvas import difference_canvas, label_canvas, view_of
from pgm_places.pictures.sheet import Panel, sheet

ABLATION = {
    "laser, stumps": "laser, stumps",
    "laser, trees": "laser, trees",
    "segments": "+ segments",
    "halls as corridors": "+ places between gates",
    WHOLE: "+ halls as a class of their own",
    GATES: "+ gates on doorways",
    AVERAGED: "+ average of the lists without one source",
    SHIPPED: "+ temperature",
    **{name: f"+ {name} on the lattice" for name in POTTS},
    **{name: name for name, recipe in RECIPES.items() if recipe.without is not None},
}
CALIBRATIONS = {
    AVERAGED: "none",
    **{name: name for name in RESCALED},
    **{name: f"temperature, {name}" for name in POTTS},
    TEMPERED: f"temperature, {TEMPERED}",
}
N_FOLDS = 6
N_WORST = 10
_PICTURE = "worst.png"


def run(setting: Setting) -> Outcome:
    """Every building, scored by models trained on the others."""
    samples = sampled_maps(setting)
    fold = building_numbers(samples, N_FOLDS)
    scored = scored_maps(setting, samples, fold)
    with setting.progress.stage("figures") as stage:
        results = map_results(scored, stage.update)
    kinds = _by_kind(results)
    worst = min(results, key=_accuracy)
    tested = {item.scored.sample.known.building for item in results}
    generated = sum(each.known.source == GENERATED for each in samples)
    return Outcome(
        setting=f"{len(tested)} buildings in {N_FOLDS} folds; every building is labelled by lists "
        "trained without its fold, those of gates included. They are trained on "
        f"{EXAMPLES_PER_MAP:,} cells of each map and of {generated} generated buildings, which are "
        f"not tested, and tested on the labelled cells of every {LATTICE_STEP}th row and column. A "
        "robot-like copy of each floor is on the same side of every split as the floor.",
        findings=tuple(_finding(kind, items) for kind, items in kinds.items()),
        tables=(_kind_table(kinds), _ablation(kinds), _calibration(kinds), _worst_table(results)),
        pictures=(Picture(_PICTURE, f"The worst map: {_name(worst)}."),),
        files={_PICTURE: _sheet(worst)},
        remarks=(
            "Accuracy, balanced accuracy and F1 are means over maps. Doors found are a share of "
            "the labelled doors, doors invented a share of the accepted gates. ECE, the expected "
            "calibration error, is over all cells, all gates or all places of at least 1 m2 of a "
            "kind.",
            "Platt's scaling and temperatures are fitted to the held-out cells of the other folds; "
            f"so is the temperature of the beliefs of {TEMPERED!r}. "
            "The rows without some of the training maps keep the gates of the full training set; "
            "the average is that of their lists, of 66 rounds each. "
            "Run it with `python -m experiments buildings`.",
        ),
    )


def _by_kind(results: Sequence[MapResult]) -> dict[str, list[MapResult]]:
    groups = sorted({item.scored.sample.known.group for item in results})
    found: dict[str, list[MapResult]] = {name: [] for name in groups}
    for item in results:
        found[item.scored.sample.known.group].append(item)
    return found


def _accuracy(result: MapResult) -> float:
    return result.evaluations[SHIPPED].accuracy


def _name(result: MapResult) -> str:
    return f"{result.scored.sample.known.item.name} ({percent(_accuracy(result))} %)"


def _finding(kind: str, results: Sequence[MapResult]) -> Finding:
    found = means(results, SHIPPED)
    return Finding(kind, found.accuracy, found.balanced_accuracy, found.doorway_f1)


def _kind_table(kinds: Mapping[str, Sequence[MapResult]]) -> Table:
    heading = (
        "kind",
        "maps",
        "accuracy",
        "balanced",
        "doorway F1",
        "doors found",
        "doors invented",
        "ECE of cells",
        "ECE of gates",
        "ECE of places",
        "worst map",
    )
    rows = []
    for kind, results in kinds.items():
        found = means(results, SHIPPED)
        figures = (found.accuracy, found.balanced_accuracy, found.doorway_f1)
        rows.append(
            (
                kind,
                str(len(results)),
                *map(percent, figures),
                *map(percent, _door_shares(results)),
                percent(found.cell_error),
                percent(found.gate_error),
                percent(found.place_error),
                _name(min(results, key=_accuracy)),
            )
        )
    return Table(
        "The list with spaces, doorways weighed by gates, temperature", heading, tuple(rows)
    )


def _door_shares(results: Sequence[MapResult]) -> tuple[float | None, float | None]:
    """The share of doors that were found, and of accepted gates that are not doors."""
    doors = [item.doors for item in results]
    total, found = sum(item.doors for item in doors), sum(item.found for item in doors)
    accepted, right = sum(item.accepted for item in doors), sum(item.right for item in doors)
    return found / total if total else None, (accepted - right) / accepted if accepted else None


def _ablation(kinds: Mapping[str, Sequence[MapResult]]) -> Table:
    rows = tuple(
        (words, *(_figures(results, step) for results in kinds.values()), _mean(kinds, step))
        for step, words in ABLATION.items()
    )
    caption = "What each step is worth: accuracy / balanced accuracy / doorway F1"
    return Table(caption, ("", *kinds, "mean of kinds"), rows)


def _figures(results: Sequence[MapResult], step: str) -> str:
    found = means(results, step)
    figures = (found.accuracy, found.balanced_accuracy, found.doorway_f1)
    return " / ".join(map(percent, figures))


def _mean(kinds: Mapping[str, Sequence[MapResult]], step: str) -> str:
    found = [means(results, step) for results in kinds.values()]
    rows = [(item.accuracy, item.balanced_accuracy, item.doorway_f1 or 0.0) for item in found]
    return " / ".join(percent(value) for value in np.mean(rows, axis=0).tolist())


def _calibration(kinds: Mapping[str, Sequence[MapResult]]) -> Table:
    rows = []
    for kind, results in kinds.items():
        cells = [
            f"{percent(means(results, step).cell_error)}, {_figures(results, step)}"
            for step in CALIBRATIONS
        ]
        rows.append((kind, *cells))
    caption = "Calibration of the list: ECE of cells, accuracy / balanced accuracy / doorway F1"
    return Table(caption, ("kind", *CALIBRATIONS.values()), tuple(rows))


def _worst_table(results: Sequence[MapResult]) -> Table:
    rows = []
    for item in sorted(results, key=_accuracy)[:N_WORST]:
        known, found = item.scored.sample.known, item.evaluations[SHIPPED]
        figures = (found.accuracy, found.balanced_accuracy, found.f1["doorway"])
        rows.append((known.item.name, known.group, *map(percent, figures)))
    heading = ("map", "kind", "accuracy", "balanced", "doorway F1")
    return Table(f"The {len(rows)} worst maps", heading, tuple(rows))


def _sheet(result: MapResult) -> bytes:
    """A PNG file: the truth, the labels found and the errors of a map, on the tested lattice."""
    sample = result.scored.sample
    grid, truth = sample.known.item.grid, result.scored.truth
    view = view_of(grid, most_pixels=400_000)
    labelled = sample.known.item.labelled_cells
    true, found = (
        np.where(labelled, _spread(values, sample.lattice), -1) for values in (truth, result.labels)
    )
    panels = [
        Panel(label_canvas(grid, true, NAMES, view), "ground truth"),
        Panel(label_canvas(grid, found, NAMES, view), f"found: {percent(_accuracy(result))} %"),
        Panel(difference_canvas(grid, true, found, NAMES, view), "errors"),
    ]
    legend = (*label_swatches(NAMES), Swatch("error", ERROR), *GROUND_SWATCHES)
    height, width = view.shape
    columns = 1 if width > 1.5 * height else 3
    return sheet(panels, columns=columns, legend=legend, long_side=900 * columns).png()


def _spread(values: NDArray[np.int64], lattice: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(H, W) the value of the nearest cell of the lattice."""
    from scipy.ndimage import distance_transform_edt

    raster = np.full(lattice.shape, -1)
    raster[lattice] = values
    r, c = distance_transform_edt(~lattice, return_distances=False, return_indices=True)
    return np.asarray(raster[r, c])
