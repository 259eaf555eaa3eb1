"""Training of the floor networks: ``python -m experiments.floor_network``.

``floors --kept FOLDER`` makes the training floors: maps that robots made, real and drawn floors,
generated buildings, and robot-like copies of all drawn ones. ``train --kept FOLDER`` trains one
network for each held-out fold of buildings, in turn; it resumes where it stopped, and
writes the learning curve to ``FOLDER/curve.csv``. ``measure --kept FOLDER`` labels every map of
DATA/robots with the network that was not trained on its building and the shipped lists, and prints
the figures by kind. ``ship --kept FOLDER`` puts the networks into the model ``default``. With
``--continued`` at every step, training starts from the first shipped network of the fold, and both
networks are measured and shipped. Training needs the extra ``train``. PGM_PLACES_DATA names the
folder of the real maps.
"""

import argparse
from pathlib import Path

from experiments.paper.setting import data_folder
from pgm_places.cli.terminal import LineProgress

STEPS = ("floors", "train", "measure", "ship")


def main(argv: list[str] | None = None) -> None:
    """Run one of the steps."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.floor_network", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("step", choices=STEPS)
    parser.add_argument("--kept", type=Path, required=True, help="folder of floors and networks")
    parser.add_argument("--steps", type=int, default=4200, help="steps of training for each fold")
    parser.add_argument(
        "--continued", action="store_true", help="start from the shipped networks of the same folds"
    )
    parser.add_argument("--folds", type=int, nargs="*", default=[0, 1, 2, 3])
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1), metavar=("I", "N"))
    given = parser.parse_args(argv)
    data = data_folder() or Path("../shared/data")
    progress = LineProgress()
    given.kept.mkdir(parents=True, exist_ok=True)
    if given.step == "floors":
        from experiments.floor_network.floors import write_floors

        write_floors(data, given.kept, tuple(given.part), progress)
    elif given.step == "train":
        from experiments.floor_network.training import train

        train(data, given.kept, given.folds, given.steps, progress, continued=given.continued)
    elif given.step == "measure":
        from experiments.floor_network.held_out import measure

        measure(data, given.kept, progress, continued=given.continued)
    else:
        from experiments.floor_network.held_out import ship

        ship(given.kept, continued=given.continued)


if __name__ == "__main__":
    main()
