"""Section 7.5: relaxation against the associative Markov network, from coarse cells to fine."""

from collections.abc import Mapping, Sequence

from experiments.paper.comparison_pictures import error_sheet, label_sheet
from experiments.paper.figures import finding, method_table
from experiments.paper.section import Finding, Outcome, Picture, Table
from experiments.paper.setting import Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.runs import compare

CELLS_M = (0.2, 0.1, 0.05)
PAPER: Mapping[tuple[float, str], float] = {(0.2, "relaxation"): 0.921, (0.2, "amn"): 0.988}


FINE_CELLS_M = (0.2, 0.1, 0.05, 0.02)
FINEST_GENERATED_M = 0.05


def run(setting: Setting) -> Outcome:
    """The paper's 20 cm, and the finer cells that exceeded its memory."""
    found = _by_cells(setting, "resolutions", CELLS_M)
    findings = _findings(found, PAPER)
    pictures, files = [], {}
    for cells_m in (CELLS_M[0], CELLS_M[-1]):
        stem = f"{round(100 * cells_m)}cm"
        files[f"labels_{stem}.png"] = label_sheet(found[cells_m])
        files[f"errors_{stem}.png"] = error_sheet(found[cells_m])
        which = " (paper, Fig. 12)" if cells_m == CELLS_M[0] else ""
        pictures += [
            Picture(f"labels_{stem}.png", f"Cells of {_centimetres(cells_m)}{which}."),
            Picture(f"errors_{stem}.png", "Errors of each method."),
        ]
    return Outcome(
        setting="Trained on the left half, tested on the right half; the list alone, then with "
        "relaxation, then with an AMN.",
        findings=findings,
        tables=(_table(found),),
        pictures=tuple(pictures),
        files=files,
    )


def fine(setting: Setting) -> Outcome:
    """A map with cells of 2 cm, at resolutions down to these."""
    finest = 0.0 if setting.data is not None else FINEST_GENERATED_M
    sides = [cells_m for cells_m in FINE_CELLS_M if cells_m >= finest]
    found = _by_cells(setting, "fine_cells", sides)
    last = found[sides[-1]]
    nodes = int((last.maps[0].node_truth >= 0).sum())
    return Outcome(
        setting="Building 79 as the COLD campaign mapped it, in 2 cm cells, from one half to "
        "the other; the lists are trained on 20,000 cells drawn at random, the methods on all "
        f"cells. At {_centimetres(sides[-1])}, {nodes:,} cells are tested.",
        findings=_findings(found, {}),
        tables=(_table(found),),
        pictures=(
            Picture("labels.png", f"Cells of {_centimetres(sides[-1])}."),
            Picture("errors.png", "Errors of each method."),
        ),
        files={"labels.png": label_sheet(last), "errors.png": error_sheet(last)},
        remarks=() if finest == 0 else ("The finest cells of generated buildings are 5 cm.",),
    )


def _by_cells(setting: Setting, name: str, sides: Sequence[float]) -> dict[float, Comparison]:
    return {
        cells_m: compare(setting.experiment(name, {"resolution_m": cells_m})) for cells_m in sides
    }


def _findings(
    found: Mapping[float, Comparison], paper: Mapping[tuple[float, str], float]
) -> tuple[Finding, ...]:
    return tuple(
        finding(
            f"{_centimetres(cells_m)}, {method.id}", method, paper=paper.get((cells_m, method.id))
        )
        for cells_m, comparison in found.items()
        for method in comparison.methods
    )


def _table(found: Mapping[float, Comparison]) -> Table:
    named = {_centimetres(cells_m): comparison for cells_m, comparison in found.items()}
    return method_table("Methods by cell size", named)


def _centimetres(cells_m: float) -> str:
    return f"{100 * cells_m:g} cm"
