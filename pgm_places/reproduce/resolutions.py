"""Section 7.5: relaxation against the associative Markov network, from coarse cells to fine."""

from collections.abc import Mapping

from pgm_places.comparison import Comparison
from pgm_places.experiment import compare
from pgm_places.reproduce.comparison_pictures import error_sheet, label_sheet
from pgm_places.reproduce.figures import finding, method_table
from pgm_places.reproduce.section import Outcome, Picture
from pgm_places.reproduce.setting import Setting

__all__ = ["run"]

CELLS_M = (0.2, 0.1, 0.05)
PAPER: Mapping[tuple[float, str], float] = {(0.2, "relaxation"): 0.921, (0.2, "amn"): 0.988}


def run(setting: Setting) -> Outcome:
    """The paper's 20 cm, and the finer cells that its memory did not hold."""
    found: dict[float, Comparison] = {}
    for cells_m in CELLS_M:
        found[cells_m] = compare(setting.experiment("resolutions", {"resolution_m": cells_m}))
    findings = [
        finding(
            f"{_centimetres(cells_m)}, {method.id}", method, paper=PAPER.get((cells_m, method.id))
        )
        for cells_m, comparison in found.items()
        for method in comparison.methods
    ]
    named = {_centimetres(cells_m): comparison for cells_m, comparison in found.items()}
    pictures, files = [], {}
    for cells_m in (CELLS_M[0], CELLS_M[-1]):
        stem = f"{round(100 * cells_m)}cm"
        files[f"labels_{stem}.png"] = label_sheet(found[cells_m])
        files[f"errors_{stem}.png"] = error_sheet(found[cells_m])
        which = " (paper, Fig. 12)" if cells_m == CELLS_M[0] else ""
        pictures += [
            Picture(f"labels_{stem}.png", f"Cells of {_centimetres(cells_m)}{which}."),
            Picture(f"errors_{stem}.png", "Where each method is wrong."),
        ]
    return Outcome(
        setting="Learned on the left half, tested on the right half; the list alone, then with "
        "relaxation, then with an AMN.",
        findings=tuple(findings),
        tables=(method_table("Methods by the side of the cells", named),),
        pictures=tuple(pictures),
        files=files,
    )


def _centimetres(cells_m: float) -> str:
    return f"{100 * cells_m:g} cm"
