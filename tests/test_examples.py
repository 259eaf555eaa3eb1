"""The gallery: short scripts; the documentation runs all of them, a test runs two."""

import ast
import io
import json
import runpy
import tokenize
from pathlib import Path

import pytest

from pgm_places import evaluate

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("plot_*.py"))

LAYOUT = (
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
)


def lines_of_code(source: str) -> int:
    """Lines that are neither blank nor comment nor the module's docstring."""
    used: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in LAYOUT:
            used.update(range(token.start[0], token.end[0] + 1))
    docstring = ast.parse(source).body[0]
    return len(used - set(range(docstring.lineno, (docstring.end_lineno or 0) + 1)))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_has_a_title(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    title, underline, *_ = (ast.get_docstring(ast.parse(source)) or "").splitlines()
    assert set(underline) == {"="}
    assert len(underline) == len(title)
    assert lines_of_code(source) <= 75


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")
@pytest.mark.parametrize(
    ("example", "alone"), [("plot_coins", "pixel by pixel"), ("plot_motorcycle", "point by point")]
)
def test_the_learned_network_beats_its_unary_and_bounds_its_score(
    example: str, alone: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("skimage")
    monkeypatch.setenv("MPLBACKEND", "agg")
    names = runpy.run_path(str(next(path for path in EXAMPLES if path.stem == example)))
    truth = names["truth"][names.get("right", slice(None))].ravel()
    accuracy = {
        name: evaluate(truth, labels.ravel(), names["names"]).accuracy
        for name, labels in names["found"].items()
    }
    assert accuracy["learned AMN"] > accuracy[alone] + 0.01
    assert accuracy["learned AMN"] == max(accuracy.values())
    assert names["labeling"].gap < 1e-3 * names["labeling"].score
    names["plt"].close("all")


def test_the_notebook_is_a_page_of_the_gallery_with_its_outputs() -> None:
    root = EXAMPLES[0].parents[1]
    cells = runpy.run_path(str(root / "tools" / "notebook.py"))["cells"]
    page = (root / "examples" / "plot_notebook.py").read_text(encoding="utf-8")
    notebook = json.loads((root / "examples" / "notebook.ipynb").read_text(encoding="utf-8"))
    found = [(cell["cell_type"], "".join(cell["source"])) for cell in notebook["cells"]]
    assert found == cells(page)
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    assert {"image/png"} <= {kind for output in outputs for kind in output.get("data", {})}
    assert "error" not in {output["output_type"] for output in outputs}
