"""Read user-defined graphs and their true labels for an experiment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError, LabelError, quoted
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.source_config import GraphConfig, SourceConfig
from pgm_places.inference.problem import LabelingProblem
from pgm_places.inference.tables import is_empty, problem_from_tables
from pgm_places.io.csv_table import GraphTables, Table, read_graphml, read_table


@dataclass(frozen=True, eq=False)
class SourceGraph:
    """A labelled graph.

    Parameters
    ----------
    name : str
        Its name in tables.
    problem : LabelingProblem
    truth : (N,) int
        True label of each node, -1 where it is unknown or observed by the methods.
    building : str
        What is held out together.
    features : (tuple of str, tuple of str)
        What the columns of its node and of its edge features are called.
    """

    name: str
    problem: LabelingProblem
    truth: NDArray[np.int64]
    building: str
    features: tuple[tuple[str, ...], tuple[str, ...]]

    def with_labels_at(self, chosen: NDArray[np.bool_]) -> "SourceGraph":
        """The whole graph with the true labels of the nodes of a mask (N,) alone."""
        return replace(self, truth=np.where(chosen, self.truth, -1))


def load_graphs(
    experiment: Experiment, part: str, like: Sequence[SourceGraph] = ()
) -> list[SourceGraph]:
    """The graphs of ``"train"`` or ``"test"``, in their order.

    ``like`` are graphs whose features these must have, too.

    Raises
    ------
    InputError
        A file cannot be read, a column is missing or holds something else than it should, or
        features differ between graphs.
    LabelError
        No node of a graph has a label to learn or to test.
    """
    graphs = experiment.loaded(part, "graphs", lambda _: True, _load)
    for index, graph in enumerate(graphs):
        _check_features([*like, *graphs][0], graph, f"{part}[{index}]")
    return graphs


def _load(experiment: Experiment, source: SourceConfig, where: str) -> SourceGraph:
    given = source.graph_options
    tables, file = _tables(experiment, given)
    name = source.name or Path(file).stem
    where = f"{where} ({name})"
    try:
        nodes = _translated(tables.nodes, given, where)
        features = _features(experiment, nodes, given.features, given.other_columns, file)
        ties = _features(experiment, tables.edges, given.edge_features, given.ends, file)
        labels = tuple(experiment.config.labels.names)
        kept = [given.node, *features, *([given.label] if given.label in nodes else [])]
        problem, truth = problem_from_tables(
            {column: _column(nodes, column) for column in kept},
            {column: _column(tables.edges, column) for column in (*given.ends, *ties)},
            node=given.node,
            ends=given.ends,
            label=given.label,
            label_names=labels,
        )
        problem = _with_more(problem, nodes, given)
    except InputError as error:
        message = str(error)
        raise type(error)(message if message.startswith(where) else f"{where}: {message}") from None
    if problem.known is not None:
        truth = np.where(problem.known >= 0, -1, truth)
    if not (truth >= 0).any():
        raise LabelError(
            f"{where}: column {given.label!r} has no label to learn or to test that is not told "
            "already; name the column of true labels with label"
        )
    building = source.building or str(given.file or given.nodes)
    return SourceGraph(name, problem, truth, building, (features, ties))


def _tables(experiment: Experiment, given: GraphConfig) -> tuple[GraphTables, str]:
    """The tables of a graph, and what its file is called."""
    path = experiment.resolve(str(given.file or given.nodes))
    if given.file is not None:
        tables = read_graphml(path, given.node, given.ends)
    else:
        ends: Table = {end: [] for end in given.ends}
        tables = GraphTables(read_table(path), ends)
        if given.edges is not None:
            edge_path = experiment.resolve(given.edges)
            tables = tables._replace(edges=read_table(edge_path))
            experiment.record_input(edge_path)
    experiment.record_input(path)
    return tables, path.name


def _translated(nodes: Table, given: GraphConfig, where: str) -> Table:
    """The nodes with labels in the configuration's names."""
    if given.classes is None:
        return nodes
    classes, translated, otherwise = given.classes, dict(nodes), given.classes.get("*", "")
    for column in filter(None, (given.label, given.known)):
        translated[column] = [
            "" if is_empty(value) else classes.get(str(value), otherwise)
            for value in _column(nodes, column)
        ]
    if all(is_empty(value) for value in translated[given.label]):
        said = sorted({str(v) for v in nodes[given.label] if not is_empty(v)})
        raise LabelError(
            f"{where}: classes translates none of {quoted(said)} in column {given.label!r}"
        )
    return translated


def _column(table: Table, name: str) -> list[Any]:
    if name not in table:
        raise InputError(f"there is no column {name!r}, only {', '.join(map(quoted, table))}")
    return table[name]


def _features(
    experiment: Experiment,
    table: Table,
    named: tuple[str, ...] | None,
    others: Sequence[str],
    where: str,
) -> tuple[str, ...]:
    """The columns of features: those named, or all of numbers; what is left out is said."""
    if named is not None:
        _check_numbers(table, named)
        return named
    features = []
    for column, values in table.items():
        if column in others:
            continue
        odd = _odd_value(values)
        if odd is None:
            features.append(column)
        else:
            experiment.warn(
                f"{where}: column {quoted(column)} holds {quoted(odd[0])}, which is not a finite "
                "number, and is left out of the features"
            )
    return tuple(features)


def _odd_value(values: Sequence[Any]) -> tuple[Any] | None:
    """The first value that is not a finite number, None if all are."""
    for value in values:
        try:
            if np.isfinite(float(value)):
                continue
        except (TypeError, ValueError, OverflowError):  # of 400 digits
            pass
        return (value,)
    return None


def _with_more(problem: LabelingProblem, nodes: Table, given: GraphConfig) -> LabelingProblem:
    """The problem with positions, evidence, and what a classifier of the user's own says."""
    graph, names = problem.graph, problem.label_names
    if given.positions is not None:
        graph = replace(graph, points_m=_numbers(nodes, given.positions))
    known = None
    if (told := given.known) is not None:
        known = np.array([_label(value, names, told) for value in _column(nodes, told)])
    if given.probabilities is None:
        return replace(problem, graph=graph, known=known)
    if len(given.probabilities) != len(names):
        raise InputError(
            f"probabilities must name a column for each of the {len(names)} labels {list(names)}, "
            f"got {list(given.probabilities)}"
        )
    return LabelingProblem.from_probabilities(
        graph,
        names,
        _numbers(nodes, given.probabilities),
        node_features=problem.node_features,
        edge_features=problem.edge_features,
        known=known,
    )


def _label(value: Any, names: Sequence[str], column: str) -> int:
    if is_empty(value):
        return -1
    if str(value) not in names:
        raise LabelError(
            f"column {column!r} holds {quoted(value)}, which is not one of {list(names)}"
        )
    return list(names).index(str(value))


def _numbers(table: Table, columns: Sequence[str]) -> NDArray[np.float64]:
    _check_numbers(table, columns)
    return np.stack([np.asarray(table[column], np.float64) for column in columns], axis=1)


def _check_numbers(table: Table, columns: Sequence[str]) -> None:
    for column in columns:
        odd = _odd_value(_column(table, column))
        if odd is not None:
            raise InputError(f"column {column!r} must hold numbers, got {quoted(odd[0])}")


def _check_features(first: SourceGraph, other: SourceGraph, where: str) -> None:
    for what, wanted, got in zip(("node", "edge"), first.features, other.features, strict=True):
        if wanted != got:
            raise InputError(
                f"{where} ({other.name}): its {what} features are {list(got)}, those of "
                f"{first.name} are {list(wanted)}; name the columns that all graphs have with "
                f"{'features' if what == 'node' else 'edge_features'}"
            )
