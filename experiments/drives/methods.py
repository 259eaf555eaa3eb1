"""Every method on the same drives, from configuration files, as tables."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import ExperimentConfig, load_config
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare
from pgm_places.spaces.door_truth import DoorScores

FOLDER = Path(__file__).parent
DRIVES = ("building79", "categories79", "simulated", "cold_freiburg", "cold_saarbrucken")
LOOP_M = 0.4
CHAIN, LOOPS, JOINT = "chain", "chain with loops", "joint with the cells"
CHAINS_ONLY = ("hmm", "semi_markov")


def methods_table(name: str) -> str:
    """Accuracy, balanced accuracy, doorway recall and passages of each method of a file here."""
    config = FOLDER / name
    found = compare(Experiment(load_config(config), FOLDER))
    lines = [
        "| method | accuracy | 95 % | balanced | doorway recall | passages found | invented |",
        "|---|---|---|---|---|---|---|",
    ]
    for method in found.methods:
        scored, interval = method.evaluation, method.intervals["accuracy"]
        doors = DoorScores.total(method.doors)
        lines.append(
            f"| `{method.id}` | {100 * scored.accuracy:.1f} | "
            f"{100 * interval.low:.1f} to {100 * interval.high:.1f} | "
            f"{100 * scored.balanced_accuracy:.1f} | "
            f"{100 * (scored.recall['doorway'] or 0.0):.1f} | "
            f"{doors.found} of {doors.doors} | {doors.invented} |"
        )
        print(lines[-1], flush=True)
    return "\n".join(lines)


def graphs_table(names: tuple[str, ...] = DRIVES) -> str:
    """Accuracy / balanced accuracy of every method on every graph, drives by drives."""
    lines = [f"| drives | method | {CHAIN} | {LOOPS} | {JOINT} |", "|---|---|---|---|---|"]
    for name in names:
        lines += _rows(load_config(FOLDER / f"{name}.toml"))
    return "\n".join(lines)


def _rows(config: ExperimentConfig) -> Iterator[str]:
    """A row per method; methods for chains have the first graph alone."""
    loopy = tuple(item for item in config.methods if item.name not in CHAINS_ONLY)
    variants = {CHAIN: config}
    variants[LOOPS] = replace(changed_config(config, {"steps.loop_m": LOOP_M}), methods=loopy)
    if "room" in config.labels.names:  # categories are labels of steps, and not of the cells
        drives = tuple(item for item in config.train if item.is_drive)  # each with its map
        variants[JOINT] = replace(config, nodes="both", train=drives, methods=loopy)
    found = {}
    for graph, variant in variants.items():
        compared = compare(Experiment(variant, FOLDER))
        found[graph] = _figures(compared)
        print(config.title, graph, found[graph], flush=True)
    for method in config.methods:
        cells = [found.get(graph, {}).get(method.id, "-") for graph in (CHAIN, LOOPS, JOINT)]
        yield f"| {config.title} | `{method.id}` | {' | '.join(cells)} |"


def _figures(found: Comparison) -> dict[str, str]:
    """Accuracy / balanced accuracy of the steps in percent, by method."""
    scored = {method.id: found.by_unit(method)["step"] for method in found.methods}
    return {
        name: f"{100 * item.accuracy:.1f} / {100 * item.balanced_accuracy:.1f}"
        for name, item in scored.items()
    }
