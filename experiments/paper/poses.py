"""Section 7.1: single poses, with every order of the decision list."""

from itertools import permutations

import numpy as np

from experiments.paper.comparison_pictures import confusion_of, error_sheet, label_sheet
from experiments.paper.figures import DOORWAY, finding, percent
from experiments.paper.section import Outcome, Picture, Table
from experiments.paper.setting import Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare, compare_fitted, train
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.models.boosted_list import BoostedList

PAPER = 0.973
SEARCHES = {
    "exhaustive": "order chosen on held-out blocks of the training half",
    "heuristic": "the paper's heuristic",
    "rarest-first": "the default",
}


def run(setting: Setting) -> Outcome:
    """All orders of the list, and the one that each way of choosing selects."""
    chosen: dict[tuple[str, ...], list[str]] = {}
    findings, comparisons = [], {}
    for search, words in SEARCHES.items():
        experiment = setting.experiment("poses", {"classifier.order": search})
        tests = load_maps(experiment, "test")
        trained = train(experiment)
        found = compare_fitted(trained, tests)
        comparisons[search] = found
        chosen.setdefault(_order(trained.labeler), []).append(search)
        paper = PAPER if search == "exhaustive" else None
        findings.append(finding(f"single poses, {words}", found.methods[0], paper=paper))
    table = _all_orders(setting, chosen, comparisons)
    shown = comparisons["exhaustive"]
    n = shown.methods[0].evaluation.n
    return Outcome(
        setting=f"{100 * shown.maps[0].grid.resolution_m:g} cm cells, 360 simulated beams, "
        f"decision list alone; trained on the left half, tested on {n:,} cells of the right half.",
        findings=tuple(findings),
        tables=(table,),
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


def _all_orders(
    setting: Setting,
    chosen: dict[tuple[str, ...], list[str]],
    known: dict[str, Comparison],
) -> Table:
    """A row per order of the list; orders chosen by a search are not learned again."""
    names = next(iter(chosen))
    rows = []
    for order in permutations(sorted(names)):
        searches = chosen.get(order, [])
        if searches:
            comparison = known[searches[0]]
        else:
            changes = {"classifier.order": list(order)}
            comparison = compare(setting.experiment("poses", changes))
        found = comparison.methods[0].evaluation
        rows.append(
            (
                " - ".join(order[:-1]),
                percent(found.accuracy),
                percent(found.balanced_accuracy),
                percent(found.recall.get(DOORWAY)),
                percent(found.precision.get(DOORWAY)),
                percent(found.f1.get(DOORWAY)),
                ", ".join(searches) or "-",
            )
        )
    heading = (
        "list", "accuracy", "balanced", "doorway recall", "doorway precision", "doorway F1",
        "chosen by",
    )  # fmt: skip
    return Table(
        "Every order of the decision list; the last place is the remainder", heading, tuple(rows)
    )
