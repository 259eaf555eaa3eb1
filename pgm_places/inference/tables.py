"""Conversion of tables of nodes and edges to problems, and of labellings to tables."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, quoted
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem


def problem_from_tables(
    nodes: Any,
    edges: Any,
    *,
    node: str = "node",
    ends: tuple[str, str] = ("source", "target"),
    label: str = "label",
    label_names: Sequence[str] | None = None,
) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """A problem from tables, and the labels (N,) of its nodes, -1 where unknown.

    Parameters
    ----------
    nodes : table
        A row per node: its name in column ``node``; its label in the optional column ``label``,
        empty (None, NaN or "") if unknown; every other column is a node feature.
    edges : table
        A row per edge: the names of its two nodes in the columns ``ends``; every other column is an
        edge feature.
    node, ends, label : str
        The names of these columns.
    label_names : sequence of str, optional
        The labels in order; by default the nodes' labels, sorted.

    Tables are pandas or polars data frames, or mappings from column names to values.

    Raises
    ------
    InputError
        A column is missing or not numeric, a name is repeated or unknown, an edge is repeated, or a
        label is not among ``label_names``.

    Examples
    --------
    >>> nodes = {"node": ["ann", "bob", "eve"], "age": [4.0, 5.0, 30.0]}
    >>> nodes["label"] = ["kid", "", "adult"]
    >>> edges = {"source": ["bob", "eve"], "target": ["ann", "ann"], "met": [9.0, 1.0]}
    >>> problem, labels = problem_from_tables(nodes, edges)
    >>> problem.label_names, labels.tolist(), problem.graph.edges.tolist()
    (('adult', 'kid'), [1, -1, 0], [[0, 1], [0, 2]])
    >>> problem.node_features.tolist(), problem.edge_features.tolist()
    ([[4.0], [5.0], [30.0]], [[9.0], [1.0]])
    """
    names = _values("nodes", nodes, node)
    number = {name: i for i, name in enumerate(names)}
    if len(number) != len(names):
        twice = next(name for i, name in enumerate(names) if number[name] != i)
        raise InputError(
            f"nodes: {quoted(twice)} appears twice in column {node!r}; give each node one row"
        )
    raw = _values("nodes", nodes, label) if label in _columns(nodes) else [None] * len(names)
    texts = [None if is_empty(value) else str(value) for value in raw]
    known = sorted({text for text in texts if text is not None})
    wanted = list(known if label_names is None else label_names)
    odd = [text for text in known if text not in wanted]
    if odd or not wanted:
        what = (
            f"{quoted(odd[0])} is not among label_names {wanted}" if odd else "no node has a label"
        )
        raise InputError(f"nodes: {what}; give label_names, all of them")
    labels = np.array([-1 if text is None else wanted.index(text) for text in texts], np.int64)
    pairs = _pairs(edges, ends, number)
    graph = replace(LabelGraph.from_edges(len(names), pairs), node_names=tuple(names))
    ties = _features("edges", edges, ends)
    looks = _features("nodes", nodes, (node, label))
    problem = LabelingProblem(
        graph,
        wanted,
        None if looks is not None else np.zeros((len(names), len(wanted))),
        looks,
        None if ties is None else graph.edge_order(pairs).values(ties),
    )
    return problem, labels


def labeling_table(problem: LabelingProblem, labeling: Labeling) -> dict[str, list[Any]]:
    """A labelling as columns with a row per node, for ``pandas.DataFrame(...)`` or ``csv``.

    ``node`` is its name, or its number without names, ``label`` the name of its label, and
    ``p(NAME)`` the belief in each label, if the method has beliefs.

    Examples
    --------
    >>> from pgm_places.inference.labeling import Status
    >>> graph = LabelGraph.from_edges(2, [(0, 1)])
    >>> problem = LabelingProblem(graph, ["kid", "adult"], np.zeros((2, 2)))
    >>> labeling_table(problem, Labeling(np.array([1, 0]), Status.EXACT))
    {'node': [0, 1], 'label': ['adult', 'kid']}
    """
    names = problem.graph.node_names
    table: dict[str, list[Any]] = {
        "node": list(range(problem.graph.n_nodes) if names is None else names),
        "label": [problem.label_names[k] for k in labeling.labels],
    }
    if labeling.beliefs is not None:
        for name, column in zip(problem.label_names, labeling.beliefs.T.tolist(), strict=True):
            table[f"p({name})"] = column
    return table


def _columns(table: Any) -> list[str]:
    return list(table.keys() if isinstance(table, Mapping) else table.columns)


def _values(what: str, table: Any, column: str) -> list[Hashable]:
    columns = _columns(table)
    if column not in columns:
        raise InputError(f"{what}: there is no column {column!r}, only {columns}; name it")
    values = np.asarray(table[column], object)
    return list(values if values.ndim == 1 else table[column])  # tuples are names, and not rows


def is_empty(value: object) -> bool:
    """Whether a value of a table is missing: None, NaN or an empty text."""
    return value is None or value == "" or value != value  # NaN is not itself


def _pairs(
    edges: object, ends: tuple[str, str], number: Mapping[Hashable, int]
) -> NDArray[np.int64]:
    """(E, 2) node numbers of the edges."""
    sides = []
    for column in ends:
        names = _values("edges", edges, column)
        odd = [name for name in names if name not in number]
        if odd:
            raise InputError(
                f"edges: {quoted(odd[0])} in column {column!r} is not a node; add its row"
            )
        sides.append([number[name] for name in names])
    return np.array(sides, np.int64).reshape(2, -1).T


def _features(what: str, table: Any, others: Sequence[str]) -> NDArray[np.float64] | None:
    """(rows, D) the columns except ``others``; None without such columns."""
    columns = []
    for column in _columns(table):
        if column in others:
            continue
        try:
            columns.append(np.asarray(table[column], np.float64))
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"{what}: column {quoted(column)} holds values that are not numbers; leave it out, "
                "or make a column of 0 and 1 of each of its values"
            ) from None
    return np.stack(columns, axis=1) if columns else None
