"""Published Bayesian networks as UAI files, solved exactly.

The networks are those of the Bayesian network repository, many of which were problems of the UAI
evaluations, too (pedigrees, MUNIN, Diabetes). They are not part of this package; the source archive
of pgmpy has them: ``pip download pgmpy==1.1.2 --no-deps --no-binary :all:``. Each is written as a
UAI file, which is read and solved: marginals of all nodes, the most probable labelling and log Z,
which is 0 for a network of probabilities, but for the digits that were published. Where ``exact``
refuses, ``toulbar2`` finds the most probable labelling, or ``trw-s`` bounds it. Width: how many
nodes separate the graph at most. Processor seconds on one thread.
"""

import gzip
import re
import sys
import tarfile
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ConfigError, InputError
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.inference.labeling import Labeling
from pgm_places.io.networks.uai import read_uai, write_uai
from pgm_places.models.factor_decoding import decode_factors

SMALLEST = 20
"""Networks of fewer nodes are left out."""


def run(archive: Path) -> list[dict[str, Any]]:
    """The rows of the table."""
    rows = []
    for name, text in sorted(_files(archive)):
        network = read_bif(text)
        if network.n_nodes < SMALLEST:
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = write_uai(Path(folder) / f"{name}.uai", network)
            size, started = path.stat().st_size, time.process_time()
            network = read_uai(path)
            read = time.process_time() - started
        rows.append(
            {
                "network": name,
                "nodes": network.n_nodes,
                "labels up to": int(max(network.n_labels)),
                "factors up to": max(len(scope) for scope in network.scopes),
                "file (kB)": round(size / 1000),
                "read (s)": read,
                **_solved(network),
            }
        )
    return rows


def _solved(network: FactorGraph) -> dict[str, Any]:
    """By the first decoder that takes it."""
    for name in ("exact", "toulbar2", "trw-s"):
        started = time.process_time()
        try:
            found = decode_factors(network, name)
        except (InputError, ConfigError):  # too large, or not installed
            continue
        return {"solved (s)": time.process_time() - started, "decoder": name, **_said(found)}
    return {"solved (s)": "-", "decoder": "refused", "width": "-", "log Z": "-"} | {
        "status": "-",
        "best score": "-",
        "bound": "-",
    }


def _said(found: Labeling) -> dict[str, Any]:
    return {
        "width": found.info.get("width", "-"),
        "log Z": found.info.get("log_partition", "-"),
        "status": str(found.status),
        "best score": found.score,
        "bound": found.bound,
    }


def read_bif(text: str) -> FactorGraph:
    """A Bayesian network in the interchange format: a table of log-probabilities for each node."""
    states = {
        name: [state.strip() for state in listed.split(",")]
        for name, listed in re.findall(
            r"variable\s+(\S+)\s*\{\s*type\s+discrete\s*\[\s*\d+\s*\]\s*\{(.*?)\}", text, re.DOTALL
        )
    }
    number = {name: node for node, name in enumerate(states)}
    scopes, tables = [], []
    for head, body in re.findall(r"probability\s*\((.*?)\)\s*\{(.*?)\n\}", text, re.DOTALL):
        child, *parents = (name for name in re.split(r"[\s|,]+", head) if name)
        scopes.append(tuple(number[name] for name in (*parents, child)))
        tables.append(_table(body, [states[name] for name in (*parents, child)]))
    with np.errstate(divide="ignore"):
        logs = [np.log(table) for table in tables]
    return FactorGraph.of([len(names) for names in states.values()], scopes, logs)


def _table(body: str, states: list[list[str]]) -> NDArray[np.float64]:
    """What the lines of a node say: one table, or a row for each labelling of its parents."""
    found = np.full([len(names) for names in states], np.nan)
    whole = re.search(r"^\s*table\s([^;]*);", body, re.MULTILINE)
    if whole:
        found[...] = np.array(whole[1].split(","), np.float64).reshape(found.shape)
    for key, row in re.findall(r"^\s*\(([^)]*)\)([^;]*);", body, re.MULTILINE):
        labels = zip(states, key.split(","), strict=False)  # the last axis is the node's own
        at = tuple(names.index(label.strip()) for names, label in labels)
        found[at] = np.array(row.split(","), np.float64)
    assert not np.isnan(found).any()
    return found


def _files(archive: Path) -> Iterator[tuple[str, str]]:
    """Names and texts of the networks in an archive."""
    with tarfile.open(archive) as opened:
        for member in opened:
            file = opened.extractfile(member) if member.name.endswith(".bif.gz") else None
            if file is not None:
                name = Path(member.name).name.removesuffix(".bif.gz")
                yield name, gzip.decompress(file.read()).decode()


if __name__ == "__main__":
    from benchmarks.__main__ import markdown_tables

    print(markdown_tables(run(Path(sys.argv[1]))))
