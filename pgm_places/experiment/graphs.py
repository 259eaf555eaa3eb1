"""Reading user-defined graphs and their true labels for an experiment."""

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
    """A labelled graph; true labels (N,) are -1 where unknown or observed.

    Graphs of one ``building`` are held out together; ``features`` names node and edge features.
    """

    name: str
    problem: LabelingProblem
    truth: NDArray[np.int64]
    building: str
    features: tuple[tuple[str, ...], tuple[str, ...]]

    def with_labels_at(self, chosen: NDArray[np.bool_]) -> "SourceGraph":
        """The graph with true labels only at the nodes of a mask (N,)."""
        return replace(self, truth=np.where(chosen, self.truth, -1))


def load_graphs(
    experiment: Experiment, part: str, like: Sequence[SourceGraph] = ()
) -> list[SourceGraph]:
    """The graphs of ``"train"`` or ``"test"``, in order, with the features of the graphs ``like``.

    InputError for unreadable files, missing or invalid columns, or other features; LabelError if no
    node of a graph has a true label that is not observed.
    """
    graphs = experiment.loaded(part, "graphs", lambda _: True, _load)
    for index, graph in enumerate(graphs):
        _check_features([*like, *graphs][0], graph, f"{part}[{index}]")
    return graphs


def _load(experiment: Experiment, source: SourceConfig, where: str) -> SourceGraph:
    options = source.graph_options
    tables, file = _tables(experiment, options)
    name = source.name or Path(file).stem
    where = f"{where} ({name})"
    try:
        nodes = _translated(tables.nodes, options, where)
        features = _features(experiment, nodes, options.features, options.other_columns, file)
        ties = _features(experiment, tables.edges, options.edge_features, options.ends, file)
        labels = tuple(experiment.config.labels.names)
        columns = [options.node, *features, *([options.label] if options.label in nodes else [])]
        problem, truth = problem_from_tables(
            {column: _column(nodes, column) for column in columns},
            {column: _column(tables.edges, column) for column in (*options.ends, *ties)},
            node=options.node,
            ends=options.ends,
            label=options.label,
            label_names=labels,
        )
        problem = _with_more(problem, nodes, options)
    except InputError as error:
        message = str(error)
        raise type(error)(message if message.startswith(where) else f"{where}: {message}") from None
    if problem.known is not None:
        truth = np.where(problem.known >= 0, -1, truth)
    if not (truth >= 0).any():
        raise LabelError(
            f"{where}: column {options.label!r} has no true labels besides the observed ones; name "
            "the column of true labels with label"
        )
    building = source.building or str(options.file or options.nodes)
    return SourceGraph(name, problem, truth, building, (features, ties))


def _tables(experiment: Experiment, options: GraphConfig) -> tuple[GraphTables, str]:
    """The tables of a graph, and the name of its file."""
    path = experiment.resolve(str(options.file or options.nodes))
    if options.file is not None:
        tables = read_graphml(path, options.node, options.ends)
    else:
        ends: Table = {end: [] for end in options.ends}
        tables = GraphTables(read_table(path), ends)
        if options.edges is not None:
            with experiment.input_path(options.edges) as edge_path:
                tables = tables._replace(edges=read_table(edge_path))
    experiment.record_input(path)
    return tables, path.name


def _translated(nodes: Table, options: GraphConfig, where: str) -> Table:
    """The nodes with labels in the configuration's names."""
    if options.classes is None:
        return nodes
    classes, translated, otherwise = options.classes, dict(nodes), options.classes.get("*", "")
    for column in filter(None, (options.label, options.known)):
        translated[column] = [
            "" if is_empty(value) else classes.get(str(value), otherwise)
            for value in _column(nodes, column)
        ]
    if all(is_empty(value) for value in translated[options.label]):
        names = sorted({str(v) for v in nodes[options.label] if not is_empty(v)})
        raise LabelError(
            f"{where}: classes translates none of {quoted(names)} in column {options.label!r}"
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
    """The feature columns: the named ones, or all numeric ones with a warning about others."""
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
                f"{where}: column {quoted(column)} has the value {quoted(odd[0])}, which is not a "
                "finite number, and is not used as a feature"
            )
    return tuple(features)


def _odd_value(values: Sequence[Any]) -> tuple[Any] | None:
    """The first value that is not a finite number, None if all are."""
    for value in values:
        try:
            if np.isfinite(float(value)):
                continue
        except (TypeError, ValueError, OverflowError):  # OverflowError: 400 digits
            pass
        return (value,)
    return None


def _with_more(problem: LabelingProblem, nodes: Table, options: GraphConfig) -> LabelingProblem:
    """The problem with positions, observed labels, and probabilities of the user's classifier."""
    graph, names = problem.graph, problem.label_names
    if options.positions is not None:
        graph = replace(graph, points_m=_numbers(nodes, options.positions))
    known = None
    if (column := options.known) is not None:
        known = np.array([_label(value, names, column) for value in _column(nodes, column)])
    if options.probabilities is None:
        return replace(problem, graph=graph, known=known)
    if len(options.probabilities) != len(names):
        raise InputError(
            f"probabilities must name a column for each of the {len(names)} labels {list(names)}, "
            f"got {list(options.probabilities)}"
        )
    return LabelingProblem.from_probabilities(
        graph,
        names,
        _numbers(nodes, options.probabilities),
        node_features=problem.node_features,
        edge_features=problem.edge_features,
        known=known,
    )


def _label(value: Any, names: Sequence[str], column: str) -> int:
    if is_empty(value):
        return -1
    if str(value) not in names:
        raise LabelError(
            f"column {column!r} has the value {quoted(value)}, which is not one of {list(names)}"
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
                f"{where} ({other.name}): its {what} features are {list(got)}, but {first.name} "
                f"has {list(wanted)}; list the common columns in "
                f"{'features' if what == 'node' else 'edge_features'}"
            )
