"""True labels by number or by name, as scikit-learn's estimators take both."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError, nearest_name, shown
from pgm_places.inference.problem import LabelingProblem

UNKNOWN = (None, "")
"""What stands in place of a name where no label is known."""


def numbered(problems: Any, labelings: Any) -> tuple[Any, bool]:
    """The labellings with numbers in place of names, and whether they had names.

    What holds no names is returned as it is, for others to check.

    Raises
    ------
    LabelError
        A name that is none of the problem's labels.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> problem = LabelingProblem(LabelGraph.from_lattice((3,)), ["rest", "walk"], np.zeros((3, 2)))
    >>> numbered([problem], [["walk", "rest", ""]])
    ([array([ 1,  0, -1])], True)
    """
    if not (isinstance(problems, Sequence) and isinstance(labelings, Sequence | np.ndarray)):
        return labelings, False
    rows = [_names_in(row) for row in labelings]
    if not any(rows) or len(rows) != len(problems):
        return labelings, False
    pairs = zip(problems, rows, labelings, strict=True)
    return [
        _numbers(m, problem, names) if names else given
        for m, (problem, names, given) in enumerate(pairs)
    ], True


def _names_in(row: Any) -> list[Any]:
    """The values of a labelling that holds names, else nothing."""
    if isinstance(row, np.ndarray) and row.dtype.kind not in "OUT":
        return []
    values = list(row) if isinstance(row, Sequence | np.ndarray) else []
    known = [value for value in values if value not in UNKNOWN]
    return values if known and all(isinstance(value, str) for value in known) else []


def _numbers(m: int, problem: LabelingProblem, names: list[Any]) -> NDArray[np.int64]:
    number = {name: k for k, name in enumerate(problem.label_names)}
    number |= dict.fromkeys(UNKNOWN, -1)  # type: ignore[arg-type]
    for i, name in enumerate(names):
        if name not in number:
            hint = nearest_name(name, list(problem.label_names))
            raise LabelError(f"labelings[{m}] has {shown(str(name))} at node {i}. {hint}")
    return np.array([number[name] for name in names], np.int64)
