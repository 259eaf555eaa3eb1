"""What counts of objects add to the laser: the paper's six categories in generated buildings.

``python -m experiments.vision`` prints the table of docs/vision.md. Buildings, the use of their
rooms and the objects in them are invented; scans and detections are simulated.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.paper.furnished_floors import DETECTORS, NAMES, Floor, make_floor
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.vision.object_counts import PAPER_OBJECTS

LEARN, LABEL = (1, 2, 3, 4), (11, 12)
"""Seeds of the buildings to learn from, and of those to label."""


def rates(
    learn: Sequence[Floor], label: Sequence[Floor], options: Mapping[str, float] | None
) -> dict[str, NDArray[np.float64]]:
    """Accuracy and recalls in per cent, from each step alone and with the filter."""
    extra = None
    if options is not None:
        extra = [floor.counts(options, k) for k, floor in enumerate(learn)]
    extra_names = () if extra is None else PAPER_OBJECTS
    labeler = TrajectoryLabeler(NAMES, extra_names=extra_names).fit(
        [], [floor.drive for floor in learn], extra=extra
    )
    truth, alone, filtered = [], [], []
    for k, floor in enumerate(label):
        seen = None if options is None else floor.counts(options, 100 + k)
        scores = labeler.scores(floor.drive, extra=seen)
        truth.append(floor.drive.labels)
        alone.append(scores.argmax(axis=1))
        filtered.append(labeler.infer(floor.drive, scores).labels)
    wanted = np.concatenate(truth)
    return {
        name: _row(wanted, np.concatenate(found))
        for name, found in (("alone", alone), ("filter", filtered))
    }


def _row(truth: NDArray[np.int64], found: NDArray[np.int64]) -> NDArray[np.float64]:
    scored = evaluate(truth, found, NAMES)
    return 100 * np.array([scored.accuracy, *(scored.recall[name] or 0.0 for name in NAMES)])


def main() -> None:
    """Print the table."""
    learn, label = [make_floor(seed) for seed in LEARN], [make_floor(seed) for seed in LABEL]
    for floors in (learn, label):
        steps = np.concatenate([floor.drive.labels for floor in floors])
        counts = [f"{int((steps == k).sum())} {name}" for k, name in enumerate(NAMES)]
        print(f"{len(steps)} steps: {', '.join(counts)}", flush=True)
    print(f"| features | steps | all | {' | '.join(NAMES)} |\n|---|---|{'---|' * (len(NAMES) + 1)}")
    for name, options in DETECTORS.items():
        for key, values in rates(learn, label, options).items():
            print(f"| {name} | {key} | {' | '.join(f'{v:.1f}' for v in values)} |", flush=True)


if __name__ == "__main__":
    main()
