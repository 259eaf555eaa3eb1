"""Every method on the drives of one configuration file, as a table."""

from pathlib import Path

from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare
from pgm_places.spaces.door_truth import DoorScores

FOLDER = Path(__file__).parent


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
