"""Tables as plain text, for terminals and logs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pgm_places.experiment.comparison import Comparison, MethodResult
    from pgm_places.spaces.door_truth import DoorScores


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Rows as aligned columns, the first left, the others right; the first row is the heading."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for index, row in enumerate(rows):
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
        if index == 0:
            lines.append("  ".join("-" * width for width in widths))
    return "\n".join(lines)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"


def comparison_table(comparison: "Comparison") -> str:
    """One row per method: accuracies, recall and precision per label (percent), seconds."""
    names = comparison.label_names
    heading = ["method", "accuracy", "95 %", "balanced", "macro F1"]
    heading += [f"{name} R|P" for name in names]
    counts_doors = any(method.doors for method in comparison.methods)
    heading += ["doors F/M/I"] if counts_doors else []
    heading += ["learn (s)", "infer (s)"]
    rows = [heading]
    for method in comparison.methods:
        found = method.evaluation
        row = [
            method.id,
            _over_seeds(method, "accuracy"),
            _interval(method),
            _over_seeds(method, "balanced_accuracy"),
            _percent(found.macro_f1),
        ]
        row += [f"{_percent(found.recall[n])}|{_percent(found.precision[n])}" for n in names]
        row += [_doors(method.doors)] if counts_doors else []
        row += [_learning(method), _spent(method.seconds.get("infer", 0.0))]
        rows.append(row)
    if comparison.gates and counts_doors:
        rows.append(
            ["gates alone", *("-" for _ in heading[1:-3]), _doors(comparison.gates), "-", "-"]
        )
    stages = ", ".join(f"{name} {value:.1f} s" for name, value in comparison.stage_seconds.items())
    note = "percent; 95 %: confidence interval of the accuracy; R recall, P precision"
    note += "; doors: F found, M missed, I invented" if counts_doors else ""
    n_seeds = len(comparison.seeds)
    note += f"; ±: standard deviation over {n_seeds} seeds" if n_seeds else ""
    parts = _differences(comparison) + _table_by_split(comparison) + _table_by_unit(comparison)
    return f"\n{text_table(rows)}\n({note}; stages: {stages}){parts}{_chosen(comparison)}"


def _differences(comparison: "Comparison") -> str:
    """The most accurate method against each of the others, on the same resamples."""
    ranked = sorted(comparison.methods, key=lambda item: -item.evaluation.accuracy)
    if len(ranked) < 2:
        return ""
    from pgm_places.experiment.judgement import points

    top, judgement = ranked[0].id, comparison.judgement
    found = [judgement.between(top, item.id) for item in ranked[1:]]
    several = found[0].buildings.n_buildings > 1
    buildings = ["buildings A/E/B", "p"] if several else []
    seeds = ["seeds A/E/B", "±"] if comparison.seeds else []
    rows = [[f"{top} against", "points", "95 %", "beyond chance", *buildings, *seeds]]
    for item in found:
        signs = item.buildings
        counts = [f"{signs.better}/{signs.even}/{signs.worse}", f"{signs.p_value:.2g}"]
        lucky = [f"{item.seeds.better}/{item.seeds.even}/{item.seeds.worse}"]
        lucky += [f"{100 * (item.spread or 0.0):.2f}"]
        rows.append(
            [
                item.second,
                points(item.shown),
                f"{points(item.interval.low)} to {points(item.interval.high)}",
                "no" if item.winner is None else "yes",
                *(counts if several else []),
                *(lucky if seeds else []),
            ]
        )
    note = "accuracy of both methods on the same resamples"
    note += "; A: ahead, E: even, B: behind" if several or seeds else ""
    note += ", p: sign test" if several else ""
    return f"\n\n{text_table(rows)}\n({note})"


def _table_by_split(comparison: "Comparison") -> str:
    """The accuracy of each method in each split."""
    if not comparison.splits:
        return ""
    rows = [["tested on", *(method.id for method in comparison.methods)]]
    found = [comparison.by_split(method) for method in comparison.methods]
    rows += [[name, *(_percent(of[name].accuracy) for of in found)] for name in comparison.splits]
    return f"\n\n{text_table(rows)}\n(accuracy by split, in percent)"


def _over_seeds(method: "MethodResult", figure: str) -> str:
    spread = method.spread(lambda one: getattr(one, figure))
    shown = _percent(getattr(method.evaluation, figure))
    return shown if spread is None else f"{shown} ±{100 * spread:.2f}"


def _table_by_unit(comparison: "Comparison") -> str:
    """Cells and steps apart, where both were labelled together."""
    if not comparison.is_mixed:
        return ""
    found = [(method.id, comparison.by_unit(method)) for method in comparison.methods]
    units = list(dict.fromkeys(item.unit for item in comparison.maps))
    heading = [f"{unit}s: {figure}" for unit in units for figure in ("accuracy", "balanced")]
    rows = [["method", *heading]]
    for name, parts in found:
        figures = [(parts[unit].accuracy, parts[unit].balanced_accuracy) for unit in units]
        rows.append([name, *(_percent(value) for pair in figures for value in pair)])
    return f"\n\n{text_table(rows)}"


def _chosen(comparison: "Comparison") -> str:
    """What was chosen on training data, a line each."""
    return "".join(f"\n{option}: {words}" for option, words in comparison.all_choices.items())


def _interval(method: "MethodResult") -> str:
    found = method.intervals.get("accuracy")
    return "-" if found is None else f"{100 * found.low:.1f}-{100 * found.high:.1f}"


def _learning(method: "MethodResult") -> str:
    """The seconds of learning, or the method that learned for this one, too."""
    if method.learned_with is not None:
        return f"with {method.learned_with}"
    return _spent(method.seconds.get("learn", 0.0))


def _spent(seconds: float) -> str:
    return "< 0.01" if 0 < seconds < 0.01 else f"{seconds:.2f}" if seconds else "-"


def _doors(doors: "Sequence[DoorScores]") -> str:
    """Doors of all maps together: found, missed and invented."""
    from pgm_places.spaces.door_truth import DoorScores

    total = DoorScores.total(doors)
    return f"{total.found}/{total.missed}/{total.invented}" if doors else "-"


def shares_line(fractions: "tuple[float, float, float]") -> str:
    """The shares of free, occupied and unknown cells."""
    free, occupied, unknown = fractions
    return (
        f"map: {100 * free:.1f} % free, {100 * occupied:.1f} % occupied, "
        f"{100 * unknown:.1f} % unknown"
    )
