"""Section 7.1: single poses, with every order of the decision list."""

from collections.abc import Mapping
from itertools import permutations

import numpy as np

from experiments.paper.comparison_pictures import confusion_of, error_sheet, label_sheet
from experiments.paper.figures import DOORWAY, finding, percent
from experiments.paper.section import Outcome, Picture, Table
from experiments.paper.setting import AS_PRINTED, BY_DEFAULT, WAYS, Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.runs import compare, train
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.models.boosted_list import BoostedList

PAPER = 0.973
PAPER_ORDER = ("room", "doorway", "corridor")
IN_SAMPLE = {"classifier.learn_on": "in-sample"}  # nothing here learns from the list's scores
ORDER = "classifier.order"


def run(setting: Setting) -> Outcome:
    """All orders of the list as printed, the one that the heuristic takes, and the defaults."""
    printed = WAYS[AS_PRINTED]
    found = {
        order: compare(
            setting.experiment("poses", IN_SAMPLE | {ORDER: list(order)}, preset=printed)
        )
        for order in permutations(sorted(PAPER_ORDER))
    }
    heuristic = _order(train(setting.experiment("poses", IN_SAMPLE, preset=printed)).labeler)
    default = compare(setting.experiment("poses"))
    shown = found[PAPER_ORDER]
    findings = [
        finding("single poses", shown.methods[0], paper=PAPER, way=AS_PRINTED),
        finding("single poses", default.methods[0]),
        finding("single poses, the heuristic's order", found[heuristic].methods[0], way=AS_PRINTED),
    ]
    n = shown.methods[0].evaluation.n
    return Outcome(
        setting=f"{100 * shown.maps[0].grid.resolution_m:g} cm cells, 360 simulated beams, "
        f"decision list alone; trained on the left half, tested on {n:,} cells of the right half. "
        f"Single poses {AS_PRINTED} have the order room - doorway, the paper's best.",
        findings=tuple(findings),
        tables=(_table(found, heuristic, default),),
        pictures=(
            Picture("labels.png", "The test half as the decision list labels it (paper, Fig. 7)."),
            Picture("errors.png", "Its errors."),
            Picture("confusion.png", "Confusion between places."),
        ),
        files={
            "labels.png": label_sheet(shown),
            "errors.png": error_sheet(shown),
            "confusion.png": confusion_of(shown.methods[0]),
        },
    )


def _order(labeler: PlaceLabeler) -> tuple[str, ...]:
    found: BoostedList = labeler.unary_model_.classifier
    labels = np.asarray(found.classes)[found.order]
    return tuple(labeler.label_names_[int(label)] for label in labels)


def _table(
    found: Mapping[tuple[str, ...], Comparison],
    heuristic: tuple[str, ...],
    default: Comparison,
) -> Table:
    """A row per order of the list, and one of the defaults."""
    rows = [
        (
            AS_PRINTED,
            " - ".join(order[:-1]),
            *_figures(item),
            "the heuristic" if order == heuristic else "the paper" if order == PAPER_ORDER else "-",
        )
        for order, item in found.items()
    ]
    unary = default.config["methods"][0]["unary"]
    rows.append((BY_DEFAULT, f"unary {unary}", *_figures(default), "-"))
    heading = (
        "options", "list", "accuracy", "balanced", "doorway recall", "doorway precision",
        "doorway F1", "chosen by",
    )  # fmt: skip
    return Table(
        "Every order of the decision list; the last place is the remainder", heading, tuple(rows)
    )


def _figures(found: Comparison) -> tuple[str, ...]:
    scored = found.methods[0].evaluation
    parts = (scored.recall, scored.precision, scored.f1)
    doors = (part.get(DOORWAY) for part in parts)
    return tuple(map(percent, (scored.accuracy, scored.balanced_accuracy, *doors)))
