"""Maps that robots made, by kind of building: ``python -m experiments.robot_maps``.

Every map of DATA/robots is labelled by the shipped model or by ``--model``. The lists of the
shipped model were not trained on these buildings, its networks on some: ``--lists-alone`` omits
the networks, and ``--held-out`` the networks trained on the building of a map. ``--maps floors``
and ``--maps real`` measure the drawn floors and the other real maps, which the shipped model has
learned from. Halls count as corridors; the next column leaves out the cells that are halls in
truth. ``--evidence MODULE:NAME`` puts log-probabilities of a map's cells in the place of the
model's, before the method smooths them; see ``experiments/robot_maps/sources.py``. The means of a
kind weigh maps by how sure their labels are; counts of doors and spaces are sums. ``--out FILE``
keeps the figures of each map as CSV, ``--sheets FOLDER`` draws all maps next to their truth, and
``--reliability`` prints how often cells, places and doors of one confidence are right.
PGM_PLACES_DATA names the folder of the real maps, ``../shared/data`` by default.
"""

import argparse
from pathlib import Path

from experiments.floor_network.held_out import shipped_without
from experiments.floor_network.sheets import LabelledPair, write_sheet, write_sheets
from experiments.paper.setting import data_folder
from experiments.robot_maps.catalogue import GROUPS, chosen_maps
from experiments.robot_maps.figures import MapFigures, measured, table, write_figures
from experiments.robot_maps.reliability import Reliability
from experiments.robot_maps.sources import Source, evidence_named, lists_alone
from pgm_places.cli.terminal import LineProgress
from pgm_places.trained import DEFAULT, trained_labeler

_WORST = 6
"""How many maps ``--worst`` draws."""


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.robot_maps", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--model", default=DEFAULT, help="a shipped model or a folder of train")
    parser.add_argument("--method", help="one of the model's methods instead of its default")
    parser.add_argument("--lists-alone", action="store_true", help="without the model's networks")
    parser.add_argument("--evidence", metavar="MODULE:NAME", help="log-probabilities of cells")
    parser.add_argument("--maps", choices=GROUPS, default="robots", help="which maps to label")
    parser.add_argument("--out", type=Path, help="a CSV file for the figures of each map")
    parser.add_argument(
        "--held-out",
        action="store_true",
        help="label each map of DATA/robots without the shipped networks trained on its building",
    )
    parser.add_argument("--worst", type=Path, help="a picture of the six worst maps")
    parser.add_argument("--sheets", type=Path, help="a folder for pictures of all maps, by kind")
    parser.add_argument("--reliability", action="store_true", help="confidence and what is right")
    arguments = parser.parse_args(argv)
    evidence = None if arguments.evidence is None else evidence_named(arguments.evidence)
    labeler = trained_labeler(arguments.model)
    if arguments.lists_alone:
        labeler = lists_alone(labeler)
    data = data_folder() or Path("../shared/data")
    of_map = shipped_without() if arguments.held_out else lambda _: labeler
    maps = list(chosen_maps(data, arguments.maps))
    figures: list[MapFigures] = []
    pairs: list[LabelledPair] = []
    reliability = Reliability()
    with LineProgress().stage("maps") as stage:
        for known, weight in maps:
            source = Source(of_map(known.item.name), arguments.method, evidence)
            labelled = source.label(known.item.grid)
            figures.append(measured(known, weight, labelled))
            pairs.append(LabelledPair(known, labelled.labels, figures[-1].cells.accuracy))
            if arguments.reliability:
                reliability.add(known, labelled)
            stage.update(len(figures) / len(maps), known.item.name)
    print(table(figures))
    if arguments.reliability:
        print(f"\n{reliability.table()}")
    if arguments.out is not None:
        write_figures(arguments.out, figures)
    if arguments.worst is not None:
        write_sheet(arguments.worst, sorted(pairs, key=lambda pair: pair.accuracy)[:_WORST])
    if arguments.sheets is not None:
        arguments.sheets.mkdir(parents=True, exist_ok=True)
        write_sheets(arguments.sheets, pairs)


if __name__ == "__main__":
    main()
