"""Training of one network for each fold of buildings, in turn, so that all are at the same step."""

import csv
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import tensorflow as tf

from experiments.floor_network.floors import Floor, all_floors, fold_of, network_file
from pgm_places.io.atomic import atomic_file
from pgm_places.progress import Progress
from pgm_places.trained import trained_floor
from pgm_places.training.crops import LabelledFloor, batch
from pgm_places.training.network_learning import BATCH, Batch, Trainer, fresh

SHARES = {
    "robot": 0.28,
    "real": 0.08,
    "drawn": 0.12,
    "simulated": 0.16,
    "generated": 0.08,
    "generated-robot": 0.10,
    "effects": 0.18,
}
"""How often a piece is cut from floors of each source."""

_ROUND = 250
"""Steps between two files, and from one fold to the next."""

_FASTEST, _CONTINUED, _SLOWEST = 2e-3, 5e-4, 1e-5
"""First rates of learning, from random parameters and from the shipped networks, and the last."""

_LEAST_LABELLED = 200


def train(
    data: Path,
    kept: Path,
    folds: Sequence[int],
    n_steps: int,
    progress: Progress,
    *,
    continued: bool = False,
) -> None:
    """Train each fold for n_steps; the rate of learning falls along half a cosine."""
    fastest = _CONTINUED if continued else _FASTEST
    cv2.setNumThreads(1)
    tf.config.threading.set_intra_op_parallelism_threads(1)
    tf.config.threading.set_inter_op_parallelism_threads(1)
    floors = list(all_floors(data))
    trainers = {fold: _trainer(kept, fold, continued=continued) for fold in folds}
    known: dict[str, LabelledFloor | None] = {}
    with progress.stage("training") as stage:
        while min(trainer.steps for trainer in trainers.values()) < n_steps:
            for fold, trainer in trainers.items():
                n = min(_ROUND, n_steps - trainer.steps)
                if n <= 0:
                    continue
                start = time.monotonic()
                pieces = _pieces(floors, kept, fold, known, trainer.steps)
                loss, accuracy = trainer.learn(
                    pieces, n, lambda step: _rate(step / n_steps, fastest)
                )
                with atomic_file(network_file(kept, fold)) as part, part.open("wb") as file:
                    np.savez(file, **trainer.state())
                seconds = (time.monotonic() - start) / n
                _note(kept, fold, trainer.steps, loss, accuracy, seconds)
                done = sum(each.steps for each in trainers.values()) / (n_steps * len(trainers))
                stage.update(done, f"fold {fold}: loss {loss:.3f}, {100 * accuracy:.1f} % right")


def _trainer(kept: Path, fold: int, *, continued: bool) -> Trainer:
    path = network_file(kept, fold)
    if not path.exists():
        return Trainer(trained_floor().networks[fold].weights if continued else fresh(fold + 1))
    with np.load(path, allow_pickle=False) as file:
        return Trainer({name: file[name] for name in file.files})


def _rate(share: float, fastest: float) -> float:
    return _SLOWEST + (fastest - _SLOWEST) * 0.5 * (1 + np.cos(np.pi * min(share, 1.0)))


def _note(kept: Path, fold: int, step: int, loss: float, accuracy: float, seconds: float) -> None:
    """A line of the learning curve."""
    path = kept / "curve.csv"
    is_new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if is_new:
            writer.writerow(("fold", "step", "loss", "accuracy", "seconds_per_step"))
        writer.writerow((fold, step, f"{loss:.4f}", f"{accuracy:.4f}", f"{seconds:.3f}"))


def _pieces(
    floors: Sequence[Floor],
    kept: Path,
    fold: int,
    known: dict[str, LabelledFloor | None],
    seed: int,
) -> Iterator[Batch]:
    """Batches from the floors of all other folds that have been made."""
    sources: dict[str, list[tuple[LabelledFloor, float]]] = {}
    folds = fold_of(list(floors))
    for floor in floors:
        if folds[floor.building] != fold:
            found = _loaded(floor, kept, known)
            if found is not None:
                sources.setdefault(floor.source, []).append((found, floor.weight))
    share = np.array([SHARES[name] for name in sources])
    pieces = [[floor for floor, _ in items] for items in sources.values()]
    weights = [np.array([weight for _, weight in items]) for items in sources.values()]
    rng = np.random.default_rng([seed, fold])
    while True:
        yield batch(
            pieces, (share / share.sum()).tolist(), [w / w.sum() for w in weights], BATCH, rng
        )


def _loaded(
    floor: Floor, kept: Path, known: dict[str, LabelledFloor | None]
) -> LabelledFloor | None:
    """A floor that has been made; None for one that has not, or has hardly a label."""
    path = kept / "floors" / f"{floor.name}.npz"
    if floor.name not in known and path.exists():
        with np.load(path, allow_pickle=False) as file:
            free, occupied, labels = (file[name] for name in ("free", "occ", "lab"))
        drawn = floor.source in ("drawn", "generated")
        enough = int((labels > 0).sum()) > _LEAST_LABELLED
        known[floor.name] = (
            LabelledFloor.of(free, occupied, labels, drawn=drawn) if enough else None
        )
    return known.get(floor.name)
