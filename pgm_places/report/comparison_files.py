"""A comparison as files: ``results.json`` for programs, ``report.html`` for people."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.significance import TESTED, Difference
from pgm_places.inference.labeling import Labeling
from pgm_places.io.atomic import write_json
from pgm_places.labelers.presets import preset_record
from pgm_places.report.comparison_tables import comparison_tables
from pgm_places.spaces.doorways import DoorScores

SCHEMA = 1

_AS_THEY_ARE = ("stage_seconds", "config", "selection", "choices", "versions", "inputs", "warnings")


def write_comparison(
    comparison: Comparison, folder: Path, *, marginals: bool = False
) -> list[Path]:
    """Write ``results.json`` and ``report.html`` into the folder; the paths written.

    With ``marginals``, the node marginals of linear programs are in ``results.json``.
    """
    from pgm_places.report.comparison_page import write_report

    results = write_json(
        folder / "results.json", comparison_record(comparison, marginals=marginals), indent=2
    )
    return [results, write_report(comparison, folder / "report.html")]


def comparison_record(comparison: Comparison, *, marginals: bool = False) -> dict[str, Any]:
    """The comparison as plain data, NaN written as null.

    ``methods.<id>`` holds accuracy, balanced_accuracy, macro_f1, recall, precision, f1, iou, mcc,
    confusion (rows are true labels), seconds, 95 % intervals, and per map the status, score, bound
    and gap. ``learned_with`` names another method whose training this one shares. With a doorway
    label, ``doors`` counts the doors found, missed and invented, in total and per map. If cells
    and steps were labelled together, ``cells`` and ``steps`` hold the figures of each.
    ``differences`` has the figures of one method less those of another, with their 95 % intervals,
    the numbers of buildings in which the first is ahead, even and behind, and the method that is
    significantly better. ``best`` names a method that is significantly better than all others.
    ``preset`` has the name of the configuration's preset, its options, and overridden options.
    With several seeds, figures are of all of them together, and ``by_seed`` of each method and
    difference has the figures of each seed. ``choices``, of the comparison and of each method, are
    the options chosen on training data. ``splits`` lists the tests of each split, ``by_split`` of
    each method its accuracies there. ``gates`` counts the doors that accepted gates match. With
    ``marginals``, ``info`` of each map has the ``node_marginals`` of linear programs. ``tables``
    has the tables of the report as text.
    """
    record = {
        "schema": SCHEMA,
        "title": comparison.title,
        "labels": comparison.label_names,
        "preset": preset_record(comparison.config),
        "seeds": comparison.seeds,
        "splits": {
            name: [comparison.maps[k].name for k in items]
            for name, items in comparison.splits.items()
        },
        "maps": [
            {
                "name": item.name,
                f"{item.unit}s_labelled": len(item.layout.cells_rc),
                f"{item.unit}s_evaluated": (item.node_truth >= 0).sum(),
            }
            | ({} if item.unit == "node" else {"resolution_m": item.grid.resolution_m})
            for item in comparison.maps
        ],
        "methods": {
            method.id: _method_record(comparison, method, marginals)
            for method in comparison.methods
        },
        "differences": [_difference_record(item) for item in comparison.judgement.differences],
        "gates": _door_record(DoorScores.total(comparison.gates)) if comparison.gates else None,
        "best": {figure: comparison.judgement.best(figure) for figure in TESTED},
        "tables": {name: item.to_dict() for name, item in comparison_tables(comparison).items()},
    } | {name: getattr(comparison, name) for name in _AS_THEY_ARE}
    plain: dict[str, Any] = _plain(record)
    return plain


def _difference_record(found: Difference) -> dict[str, object]:
    interval, signs = found.interval, found.buildings
    return {
        **{name: getattr(found, name) for name in ("first", "second", "figure")},
        "difference": interval.estimate,
        "low": interval.low,
        "high": interval.high,
        "buildings": {
            "ahead": signs.better,
            "even": signs.even,
            "behind": signs.worse,
            "p": signs.p_value,
        },
        "better": found.winner,
    } | ({"by_seed": found.by_seed, "spread": found.spread} if found.by_seed else {})


def _method_record(comparison: Comparison, method: MethodResult, marginals: bool) -> dict[str, Any]:
    names = [item.name for item in comparison.maps]
    record: dict[str, Any] = method.evaluation.to_dict()
    record["seconds"] = {**method.seconds, "total": float(sum(method.seconds.values()))}
    record["intervals"] = {
        key: {"low": item.low, "high": item.high} for key, item in method.intervals.items()
    }
    if method.learned_with is not None:
        record["learned_with"] = method.learned_with
    record |= {"method": method.name, "options": method.options, "learned": method.learned}
    record |= {"choices": method.choices} if method.choices else {}
    record["maps"] = {
        name: {**evaluation.to_dict(), **_labeling_record(labeling, marginals)}
        for name, evaluation, labeling in zip(
            names, method.evaluations, method.labelings, strict=True
        )
    }
    if method.doors:
        record["doors"] = _door_record(DoorScores.total(method.doors))
        for name, doors in zip(names, method.doors, strict=True):
            record["maps"][name]["doors"] = _door_record(doors)
    if comparison.is_mixed:  # cells and steps apart
        by_unit = comparison.by_unit(method).items()
        record |= {f"{unit}s": found.to_dict() for unit, found in by_unit}
    runs: dict[str, Mapping[Any, Evaluation]] = {
        "by_seed": {seed: item.evaluation for seed, item in method.by_seed.items()},
        "by_split": comparison.by_split(method),
    }
    for kind, evaluations in runs.items():
        if evaluations:
            record[kind] = {
                name: {figure: getattr(item, figure) for figure in TESTED}
                for name, item in evaluations.items()
            }
    return record


def _door_record(doors: DoorScores) -> dict[str, Any]:
    names = ("found", "missed", "invented", "recall", "precision")
    return {name: getattr(doors, name) for name in names}


def _labeling_record(labeling: Labeling, marginals: bool) -> dict[str, object]:
    record = {name: getattr(labeling, name) for name in ("score", "bound", "gap")}
    info = {
        name: value
        for name, value in labeling.info.items()
        if marginals or name != "node_marginals"
    }
    return {"status": str(labeling.status), **record, "info": info}


def _plain(value: Any) -> Any:
    """Nested mappings, sequences and NumPy values as JSON types; NaN and infinity as None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)
