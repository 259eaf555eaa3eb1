"""Networks, evidence and results as the files of the UAI inference competitions."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import integer_array
from pgm_places.errors import InputError
from pgm_places.inference.factor_graph import MOST_LABELS, MOST_NODES, FactorGraph
from pgm_places.inference.labeling import Labeling
from pgm_places.io.atomic import write_text
from pgm_places.io.input_file import read_text

MAX_BYTES = 1 << 30
_NETWORK = "a network (UAI)"
_MOST_DIGITS = 12
_LARGEST = 700.0
"""Largest absolute log-potential: exp of larger ones overflows or loses digits in float64."""

Task = Literal["MAP", "MAR", "PR"]


@dataclass(frozen=True, eq=False)
class UaiResult:
    """The content of a result file; None for results that it does not contain.

    The label (N,) of each node from MAP or MPE, the probability of each label from MAR, and the
    natural logarithm of the partition function from PR, for which files use base 10.
    """

    labels: NDArray[np.int64] | None = None
    beliefs: tuple[NDArray[np.float64], ...] | None = None
    log_partition: float | None = None


def read_uai(path: Path | str) -> FactorGraph:
    """The factors of a Markov or Bayesian network, as log-potentials; 0 becomes -inf."""
    words = _Words(Path(path), _NETWORK)
    kind = words.text("MARKOV or BAYES").upper()
    if kind not in ("MARKOV", "BAYES"):
        raise words.wrong(f"must begin with MARKOV or BAYES, got {kind[:20]!r}")
    most = MOST_LABELS + 1
    sizes = [words.whole("a number of labels", least=1, below=most) for _ in words.each("nodes")]
    scopes = [
        [
            words.whole("a node", below=len(sizes))
            for _ in words.each(f"nodes of factor {number}", at_most=MOST_NODES)
        ]
        for number, _ in enumerate(words.each("factors"))
    ]
    for number, scope in enumerate(scopes):
        if len(set(scope)) < len(scope):
            raise words.wrong(f"names a node twice in factor {number}")
    tables = []
    for number, scope in enumerate(scopes):
        shape = [sizes[node] for node in scope]
        count = words.whole(f"the size of table {number}")
        if count != math.prod(shape):
            raise words.wrong(f"table {number} must have {math.prod(shape)} entries, got {count}")
        tables.append(words.numbers(count, f"table {number}").reshape(shape))
    words.end()
    with np.errstate(divide="ignore"):  # log 0 = -inf is intended
        return FactorGraph.of(
            np.array(sizes, np.int64), scopes, [np.log(table) for table in tables]
        )


def write_uai(path: Path | str, graph: FactorGraph) -> Path:
    """Write the factors as a Markov network; returns the path.

    Raises
    ------
    InputError
        A log-potential whose exponential is beyond float64: UAI files hold no logarithms.
    """
    lines = ["MARKOV", str(graph.n_nodes), _joined(graph.n_labels), str(len(graph.scopes))]
    lines += [_joined([len(scope), *scope]) for scope in graph.scopes]
    for number, table in enumerate(graph.tables):
        finite = table[table > -np.inf]
        if len(finite) and np.abs(finite).max() > _LARGEST:
            raise InputError(
                f"table {number} holds a log-potential of {finite[np.abs(finite).argmax()]:.6g}, "
                "whose exponential UAI files cannot hold; divide or shift the log-potentials, or "
                "write OpenGM's format, which holds logarithms"
            )
        lines += ["", str(table.size), _joined(np.exp(table).ravel())]
    return write_text(path, "\n".join(lines) + "\n")


def read_evidence(path: Path | str, n_nodes: int) -> NDArray[np.int64]:
    """(N,) the label of each node in an evidence file, -1 elsewhere.

    A leading count of evidence sets is optional and must be 1.
    """
    words = _Words(Path(path), "evidence (UAI)")
    numbers = words.rest_whole()
    if len(numbers) > 1 and numbers[0] == 1 and len(numbers) == 2 + 2 * numbers[1]:
        numbers = numbers[1:]
    if not numbers or len(numbers) != 1 + 2 * numbers[0]:
        raise words.wrong("must hold a number of nodes, then a node and its label for each")
    known = np.full(n_nodes, -1)
    for node, label in zip(numbers[1::2], numbers[2::2], strict=True):
        if node >= n_nodes:
            raise words.wrong(f"names node {node}, but the network has {n_nodes}")
        if label >= MOST_LABELS:
            raise words.wrong(f"gives node {node} the label {label}, more than any node has")
        if known[node] not in (-1, label):
            raise words.wrong(f"gives node {node} two labels, {known[node]} and {label}")
        known[node] = label
    return known


def write_evidence(path: Path | str, known: NDArray[np.int64]) -> Path:
    """Write observed labels, (N,) int with -1 elsewhere; returns the path."""
    labels = integer_array("known", known, ("N",), low=-1, high=2**31)
    nodes = np.flatnonzero(labels >= 0)
    pairs = np.stack([nodes, labels[nodes]], axis=1).ravel()
    return write_text(path, _joined([len(nodes), *pairs]) + "\n")


def write_uai_result(
    path: Path | str, labeling: Labeling, task: Task, *, graph: FactorGraph
) -> Path:
    """Write the result of a task; returns the path.

    Parameters
    ----------
    path : Path
    labeling : Labeling
        The result of :func:`~pgm_places.models.factor_decoding.decode_factors`.
    task : {"MAP", "MAR", "PR"}
        The best labelling, the probability of each label, or the partition function.
    graph : FactorGraph

    Raises
    ------
    InputError
        The labelling has no beliefs or no partition function; ``exact`` computes both.
    """
    if task == "MAP":
        body = _joined([len(labeling.labels), *labeling.labels])
    elif task == "MAR":
        if labeling.beliefs is None:
            raise InputError(f"MAR needs beliefs, which this labelling lacks: {labeling}")
        rows = zip(graph.n_labels.tolist(), labeling.beliefs, strict=True)
        body = " ".join([str(graph.n_nodes), *(f"{n} {_joined(row[:n])}" for n, row in rows)])
    else:
        value = labeling.info.get("log_partition")
        if value is None:
            raise InputError("PR needs a partition function: take the decoder 'exact'")
        body = repr(float(value) / math.log(10))
    return write_text(path, f"{task}\n{body}\n")


def read_uai_result(path: Path | str) -> UaiResult:
    """The content of a result file of MAP, MPE, MAR or PR; a leading count of 1 is optional."""
    words = _Words(Path(path), "a result (UAI)")
    task = words.text("MAP, MPE, MAR or PR").upper()
    if task == "PR":
        value = float(words.rest()[-1])
        if not value < np.inf:  # also true of NaN
            raise words.wrong(f"must hold a logarithm (-inf for 0), got {value}")
        return UaiResult(log_partition=value * math.log(10))
    if task not in ("MAP", "MPE", "MAR"):
        raise words.wrong(f"must begin with MAP, MPE, MAR or PR, got {task[:20]!r}")
    numbers = words.rest()
    for values in (numbers, numbers[1:]):  # without or with a leading count of evidence sets
        if task == "MAR":
            beliefs = _beliefs(values)
            if beliefs is not None:
                return UaiResult(beliefs=beliefs)
        elif len(values) and len(values) == 1 + values[0]:
            labels = values[1:]
            bad = ~((labels >= 0) & (labels < MOST_LABELS) & (labels == np.floor(labels)))
            if bad.any():
                raise words.wrong(f"must hold labels from 0, got {labels[bad][0]:g}")
            return UaiResult(labels=labels.astype(np.int64))
    raise words.wrong("must hold the number of nodes, then the values of each node")


def _beliefs(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...] | None:
    """Beliefs from a count of rows and their lengths; None if the counts do not fit."""
    if not len(values):
        return None
    rows, at, left = [], 1, values[0]
    while left > 0 and at < len(values):
        size = values[at]
        if not 1 <= size < len(values) - at or size != np.floor(size):
            return None
        rows.append(values[at + 1 : at + 1 + int(size)])
        at += 1 + int(size)
        left -= 1
    sums = [row.sum() for row in rows]
    is_complete = left == 0 and at == len(values) and np.allclose(sums, 1, rtol=0, atol=1e-3)
    return tuple(rows) if is_complete and (values[1:] >= 0).all() else None


def _joined(values: "NDArray[np.float64] | NDArray[np.int64] | list[int]") -> str:
    """Numbers with all digits, to be read back unchanged."""
    return " ".join(repr(value) for value in np.asarray(values).tolist())


class _Words:
    """A reader of a file's words, with positions in its error messages."""

    def __init__(self, path: Path, what: str) -> None:
        self.path, self.what = path, what
        self._words = read_text(path, InputError, what, max_bytes=MAX_BYTES).split()
        self._at = 0

    def wrong(self, text: str) -> InputError:
        return InputError(f"{self.path}: {self.what} {text} (word {self._at})")

    def text(self, wanted: str) -> str:
        if self._at >= len(self._words):
            raise self.wrong(f"ends where {wanted} should be")
        self._at += 1
        return self._words[self._at - 1]

    def whole(self, wanted: str, *, least: int = 0, below: int = 2**31) -> int:
        word = self.text(wanted)
        digits = word.lstrip("0") or "0"
        is_number = word.isascii() and word.isdigit() and len(digits) <= _MOST_DIGITS
        if not is_number or not least <= int(digits) < below:
            raise self.wrong(f"has {word[:20]!r} where {wanted} should be")
        return int(digits)

    def each(self, wanted: str, *, at_most: int = 2**31) -> Iterator[int]:
        """Indices up to the count that is the next word."""
        count = self.whole(f"the number of {wanted}", below=at_most + 1)
        if count > len(self._words):
            raise self.wrong(f"states {count} {wanted}, but ends before")
        return iter(range(count))

    def numbers(self, count: int, wanted: str) -> NDArray[np.float64]:
        words = self._words[self._at : self._at + count]
        if len(words) < count:
            raise self.wrong(f"ends within {wanted}")
        self._at += count
        values = self._numbers(words, f"words in {wanted},")
        if not np.isfinite(values).all() or values.min(initial=0.0) < 0:
            raise self.wrong(f"must hold numbers of at least 0 in {wanted}")
        return values

    def rest(self) -> NDArray[np.float64]:
        words, self._at = self._words[self._at :], len(self._words)
        if not words:
            raise self.wrong("ends too early")
        return self._numbers(words, "words")

    def rest_whole(self) -> list[int]:
        return [self.whole("a number") for _ in range(self._at, len(self._words))]

    def end(self) -> None:
        if self._at < len(self._words):
            raise self.wrong(f"continues after its last table with {self._words[self._at][:20]!r}")

    def _numbers(self, words: list[str], what: str) -> NDArray[np.float64]:
        try:
            return np.array(words, np.float64)
        except ValueError:
            raise self.wrong(f"holds {what} where numbers should be") from None
