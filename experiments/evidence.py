"""How much evidence that repeats itself may count: the categories of building 79's log."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from experiments.paper.categories import CATEGORY_NAMES, Building79
from pgm_places.labelers.trajectory_labeler import REACH_M, TrajectoryLabeler
from pgm_places.labelers.trajectory_learning import learn_list, learn_method, trajectory_examples
from pgm_places.models.hmm import MODES, HiddenMarkovModel
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.scan_model import BeamOptions, observed_along

HEAD = (
    "| beams | every | weight: filter / smoother / Viterbi | training half, held out: alone | "
    "filter | smoother | Viterbi | other half: alone | filter | smoother | Viterbi |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|"
)


def evidence_table(data: Building79) -> str:
    """Rates per way between updates, of the evidence as it is and with its fitted weight."""
    beams = {"front only": BeamOptions("max-range"), "rear from the local map": BeamOptions()}
    rows = [row for name, item in beams.items() for row in _rows(data, name, item)]
    return "\n".join([HEAD, *rows])


def _rows(data: Building79, name: str, beams: BeamOptions) -> Iterator[str]:
    """The list learns once; the method learns anew for each way between updates."""
    names = CATEGORY_NAMES
    sensor = Sensor(max_range_m=REACH_M)
    path = data.path.with_labels(np.where(data.left, -1, data.category), names)
    truth = np.where(data.left, data.category, -1)
    labeler = TrajectoryLabeler(names, sensor=sensor, beams=beams)
    examples = trajectory_examples(labeler, [], [path])
    model, held_out = learn_list(labeler, examples)
    learned = path.subset(examples.steps[0])
    scores = model.log_proba(observed_along(path, sensor, beams).circles_m)
    for every_m in (0.1, 0.3, 0.5):
        labeler.set_params(every_m=every_m)
        method = learn_method(labeler, labeler.method, [], [path], examples, held_out)
        assert isinstance(method, HiddenMarkovModel)
        assert method.fitted_weights is not None
        plain = replace(method, evidence_weight=1.0)
        for kind, weights in ((plain, "1"), (method, _joined(method.fitted_weights, "g"))):
            rates = [100 * float(np.mean(held_out.argmax(axis=1) == examples.rows.truth))]
            tests = [_rate(scores.argmax(axis=1), truth)]
            for mode in MODES:
                used = TrajectoryLabeler.of_parts(
                    names, replace(kind, mode=mode), model, every_m=every_m, beams=beams
                )
                rates.append(_rate(used.infer(learned, held_out).labels, examples.rows.truth))
                tests.append(_rate(used.infer(path, scores).labels, truth))
            cells = " | ".join(f"{rate:.1f}" for rate in (*rates, *tests))
            yield f"| {name} | {every_m:g} m | {weights} | {cells} |"
            print(name, every_m, weights, cells, flush=True)


def _rate(labels: np.ndarray, truth: np.ndarray) -> float:
    return 100 * float(np.mean(labels[truth >= 0] == truth[truth >= 0]))


def _joined(values: np.ndarray, style: str) -> str:
    return " / ".join(format(value, style) for value in values.tolist())
