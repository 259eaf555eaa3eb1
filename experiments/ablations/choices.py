"""Options chosen on held-out training cells, compared with all others on the test half."""

from experiments.paper.figures import DOORWAY, finding, percent
from experiments.paper.section import Finding, Outcome, Table
from experiments.paper.setting import Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare
from pgm_places.experiment.selection import Selection, select
from pgm_places.experiment.sources import Sources

CHOICES = {"choices_list": "decision list, 5 cm", "choices_network": "associative network, 20 cm"}


def run(setting: Setting) -> Outcome:
    """Every combination, held out and tested: how well the first score predicts the second."""
    findings: list[Finding] = []
    tables = []
    for name, words in CHOICES.items():
        experiment = setting.experiment(name)
        found = select(experiment, Sources(load_maps(experiment, "train")))
        rows = []
        for item in found.candidates:
            tested = setting.experiment(name, {**item.options, "select": None})
            comparison = compare(tested)
            chosen = item is found.chosen
            rows.append(
                (
                    ", ".join(f"{_option(key)} {value}" for key, value in item.options.items()),
                    f"{percent(item.score)} ± {percent(item.spread)}",
                    *_tested(comparison),
                    "chosen" if chosen else "-",
                )
            )
            if chosen:
                findings.append(finding(f"{words}, chosen", comparison.methods[0]))
        tables.append(_table(words, found, tuple(rows)))
    return Outcome(
        setting="Building 79: options are chosen on held-out contiguous blocks of the left half "
        "and tested on the right half. Held-out figures are the balanced accuracy over all blocks "
        "together, with the standard deviation over single blocks.",
        findings=tuple(findings),
        tables=tuple(tables),
    )


def _option(key: str) -> str:
    return key.rpartition(".")[2].replace("_", " ")


def _tested(comparison: Comparison) -> tuple[str, ...]:
    found = comparison.methods[0].evaluation
    figures = (found.balanced_accuracy, found.accuracy, found.f1.get(DOORWAY))
    return tuple(percent(value) for value in figures)


def _table(words: str, found: Selection, rows: tuple[tuple[str, ...], ...]) -> Table:
    heading = ("options", "held out", "tested, balanced", "accuracy", "doorway F1", "")
    caption = f"{words}: {len(found.candidates)} combinations"
    return Table(caption[0].upper() + caption[1:], heading, rows)
