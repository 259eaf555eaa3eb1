"""Tagging with thousands of indicators, scaled in several ways: python -m experiments.indicators.

Names in the source of Python's own library, statement by statement and without anything between
them, are to be told what they are: something called, assigned, an attribute. What is known of a
name are indicators: the name, its first and last three letters, its spelling, and its neighbours.
Rare ones are many, and most of them chance. Prints the table of docs/crf.md; ``sklearn-crfsuite``
takes part where it is installed.
"""

import io
import keyword
import sysconfig
import tokenize
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from experiments.paper.markdown import markdown_table
from experiments.paper.section import Table
from pgm_places import LabelGraph, LabelingProblem, build, evaluate

ROLES = ("defined", "parameter", "called", "attribute", "keyword", "assigned", "used")
LEARNING = ("argparse", "configparser", "difflib", "ftplib")
TESTING = ("calendar", "pickle", "textwrap")
SHORTEST = 3
"""Statements of fewer names are left out."""

ON_EDGES = {"edge_features": ("constant",)}
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "CRF, likelihood": ("crf", {}),
    "CRF, likelihood, `C = 10_000`": ("crf", {"C": 10_000.0}),
    "CRF, max margin": ("crf", {"learner": "max-margin"}),
    "AMN": ("amn", ON_EDGES),
    "AMN, `C = 1000`": ("amn", {**ON_EDGES, "C": 1000.0}),
}
SCALES = ("deviation", "auto")

Statement = tuple[list[str], NDArray[np.int64]]
"""Names and their roles."""


def statements(modules: Sequence[str]) -> list[Statement]:
    """The statements of modules of the standard library."""
    folder = Path(sysconfig.get_paths()["stdlib"])
    found = []
    for module in modules:
        text = (folder / f"{module}.py").read_text(encoding="utf-8")
        found += [_names(tokens) for tokens in _tokens(text)]
    return [item for item in found if len(item[0]) >= SHORTEST]


def _tokens(text: str) -> Iterator[list[str]]:
    """Names and operators, statement by statement."""
    tokens: list[str] = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NEWLINE:
            yield tokens
            tokens = []
        elif token.type in (tokenize.NAME, tokenize.OP):
            tokens.append(token.string)


def _names(tokens: list[str]) -> Statement:
    names, roles, depth = [], [], 0
    for at, token in enumerate(tokens):
        depth += (token in "([{") - (token in ")]}")
        if token.isidentifier() and not keyword.iskeyword(token):
            before = tokens[at - 1] if at else ""
            after = tokens[at + 1] if at + 1 < len(tokens) else ""
            names.append(token)
            roles.append(ROLES.index(_role(tokens[0], before, after, depth)))
    return names, np.array(roles, np.int64)


def _role(first: str, before: str, after: str, depth: int) -> str:
    if before in ("def", "class"):
        return "defined"
    if first == "def" and depth == 1 and before in "(,*":
        return "parameter"
    if after == "(":
        return "called"
    if before == ".":
        return "attribute"
    if after == "=":
        return "keyword" if depth else "assigned"
    return "used"


def indicators(names: Sequence[str], at: int) -> list[str]:
    """What is known of a name."""
    name = names[at]
    spelling = "upper" if name.isupper() else "title" if name[0].isupper() else "lower"
    found = [name, f"{name[:3]}-", f"-{name[-3:]}", f"{spelling}{name[0] == '_'}{'_' in name[1:]}"]
    for step in (-1, 1):
        other = names[at + step] if 0 <= at + step < len(names) else ""
        found += [f"{step} {other}", f"{step} -{other[-3:]}"]
    return [f"{kind}: {text}" for kind, text in enumerate(found)]


def problems_of(
    learning: Sequence[Statement], testing: Sequence[Statement]
) -> tuple[list[LabelingProblem], list[LabelingProblem]]:
    """Chains with a column for each indicator that occurs in what is learned from."""
    column: dict[str, int] = {}
    for names, _ in learning:
        for at in range(len(names)):
            for text in indicators(names, at):
                column.setdefault(text, len(column))

    def problem(names: list[str]) -> LabelingProblem:
        known = [
            (at, column[text])
            for at in range(len(names))
            for text in indicators(names, at)
            if text in column
        ]
        rows, columns = np.array(known).T
        looks: Any = sp.csr_array((np.ones(len(rows)), (rows, columns)), (len(names), len(column)))
        return LabelingProblem(LabelGraph.from_lattice((len(names),)), ROLES, node_features=looks)

    return [problem(names) for names, _ in learning], [problem(names) for names, _ in testing]


def crfsuite(learning: Sequence[Statement], testing: Sequence[Statement]) -> NDArray[np.int64]:
    """The labels of sklearn-crfsuite with its default options."""
    import sklearn_crfsuite

    def items(names: list[str]) -> list[dict[str, float]]:
        return [dict.fromkeys(indicators(names, at), 1.0) for at in range(len(names))]

    model = sklearn_crfsuite.CRF(algorithm="lbfgs")
    model.fit([items(names) for names, _ in learning], [list(map(str, t)) for _, t in learning])
    found = model.predict([items(names) for names, _ in testing])
    return np.array([int(label) for row in found for label in row])


def rates(found: NDArray[np.int64], truth: NDArray[np.int64]) -> str:
    """Accuracy and macro F1 in percent."""
    result = evaluate(truth, found, ROLES)
    return f"{100 * (result.accuracy or 0.0):.1f} / {100 * (result.macro_f1 or 0.0):.1f}"


def main() -> None:
    """Print the table."""
    learning, testing = statements(LEARNING), statements(TESTING)
    seen, asked = problems_of(learning, testing)
    truths = [roles for _, roles in learning]
    truth = np.concatenate([roles for _, roles in testing])
    rows = []
    for method, (name, options) in METHODS.items():
        found = []
        for scale in SCALES:
            model = build(name, {**options, "scale": scale}).fit(seen, truths)
            labels = np.concatenate([model.infer(problem).labels for problem in asked])
            found.append(rates(labels, truth))
        rows.append((method, *found))
    if find_spec("sklearn_crfsuite"):
        rows.append(("sklearn-crfsuite", "", rates(crfsuite(learning, testing), truth)))
    count = sum(map(len, truths)), seen[0].node_features.shape[1]  # type: ignore[union-attr]
    print(
        f"{count[0]:,} names to learn from, {count[1]:,} indicators, {len(truth):,} names to label"
    )
    heads = ("method", *(f'`scale = "{scale}"`' for scale in SCALES))
    print(markdown_table(Table("", heads, tuple(rows))))


if __name__ == "__main__":
    main()
