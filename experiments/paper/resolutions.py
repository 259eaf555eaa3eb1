"""Section 7.5: relaxation against the associative Markov network, from coarse cells to fine."""

from collections.abc import Mapping, Sequence

from experiments.paper.comparison_pictures import error_sheet, label_sheet
from experiments.paper.figures import by_way, method_findings, method_table
from experiments.paper.section import Finding, Outcome, Picture
from experiments.paper.setting import BY_DEFAULT, WAYS, Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.runs import compare

CELLS_M = (0.2, 0.1, 0.05)
PAPER = {"20 cm, relaxation": 0.921, "20 cm, amn": 0.988}
FINE_CELLS_M = (0.2, 0.1, 0.05, 0.02)
FINEST_GENERATED_M = 0.05


def run(setting: Setting, cells_m: Sequence[float] = CELLS_M) -> Outcome:
    """The paper's 20 cm, and the finer cells that exceeded its memory."""
    pictures, files, found = [], {}, _by_cells(setting, "resolutions", cells_m)
    for way, of_way in found.items():
        stem, coarse = way.replace(" ", "_"), next(iter(of_way.values()))
        files |= {
            f"labels_{stem}.png": label_sheet(coarse),
            f"errors_{stem}.png": error_sheet(coarse),
        }
        pictures += [
            Picture(f"labels_{stem}.png", f"Cells of 20 cm, {way} (paper, Fig. 12)."),
            Picture(f"errors_{stem}.png", f"Errors of each method, {way}."),
        ]
    return Outcome(
        setting="Trained on the left half, tested on the right half; the list alone, then with "
        "relaxation, then with an AMN, all three on the same list.",
        findings=_findings(found, PAPER),
        tables=(method_table("Methods by cell size", by_way(found)),),
        pictures=tuple(pictures),
        files=files,
    )


def fine(setting: Setting) -> Outcome:
    """A map with cells of 2 cm, at resolutions down to these."""
    finest = 0.0 if setting.data is not None else FINEST_GENERATED_M
    sides = [cells_m for cells_m in FINE_CELLS_M if cells_m >= finest]
    found = _by_cells(setting, "fine_cells", sides)
    last = found[BY_DEFAULT][_centimetres(sides[-1])]
    nodes = int((last.maps[0].node_truth >= 0).sum())
    return Outcome(
        setting="Building 79 as the COLD campaign mapped it, in 2 cm cells, from one half to "
        "the other; the lists are trained on 20,000 cells drawn at random, the methods on all "
        f"cells. At {_centimetres(sides[-1])}, {nodes:,} cells are tested.",
        findings=_findings(found, {}),
        tables=(method_table("Methods by cell size", by_way(found)),),
        pictures=(
            Picture("labels.png", f"Cells of {_centimetres(sides[-1])}, {BY_DEFAULT}."),
            Picture("errors.png", "Errors of each method."),
        ),
        files={"labels.png": label_sheet(last), "errors.png": error_sheet(last)},
        remarks=() if finest == 0 else ("The finest cells of generated buildings are 5 cm.",),
    )


def _by_cells(
    setting: Setting, name: str, sides: Sequence[float]
) -> dict[str, dict[str, Comparison]]:
    """The methods by way and by size of cells."""
    return {
        way: {
            _centimetres(side): compare(
                setting.experiment(name, {"resolution_m": side}, preset=preset)
            )
            for side in sides
        }
        for way, preset in WAYS.items()
    }


def _findings(
    found: Mapping[str, Mapping[str, Comparison]], paper: Mapping[str, float]
) -> tuple[Finding, ...]:
    return tuple(
        item for way, of_way in found.items() for item in method_findings(of_way, paper, way)
    )


def _centimetres(cells_m: float) -> str:
    return f"{100 * cells_m:g} cm"
