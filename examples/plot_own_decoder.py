"""
Your own decoder, in 25 lines
=============================

A grid with random tables is hard: relaxations are fractional, and local search ends far below the
optimum. Simulated annealing is not built in. Registered under a name, it works like every decoder:
in ``decode``, as the methods' option ``inference``, and in the check that all decoders of the
package pass.
"""

import matplotlib.pyplot as plt
import numpy as np

from pgm_places import LabelGraph, Potentials, Status, decode
from pgm_places.models.decoder_checks import check_decoder
from pgm_places.models.decoders import DecodingAnswer, DecodingTask, register_decoder


def anneal(task: DecodingTask) -> DecodingAnswer:
    """Nodes are drawn at random given their neighbours, from ever colder distributions."""
    rng = np.random.default_rng(0)
    unary, tables = task.potentials.unary, task.potentials.edge_tables(task.graph)
    around = [[] for _ in unary]
    for (i, j), table in zip(task.graph.edges, tables, strict=True):
        around[i].append((j, table.T))
        around[j].append((i, table))
    unit = max(np.abs(t[np.isfinite(t)]).max(initial=0.0) for t in (unary, tables))
    labels = unary.argmax(axis=1)
    for sweep in range(task.limit or 80):
        heat = unit * 0.92**sweep + 1e-300
        for i in rng.permutation(len(unary)):
            scores = unary[i] + sum(table[labels[j]] for j, table in around[i])
            labels[i] = (scores / heat + rng.gumbel(size=len(scores))).argmax()
        nodes, (first, second) = np.arange(len(labels)), task.graph.edges.T
        pairs = tables[np.arange(len(tables)), labels[first], labels[second]]
        task.record(sweep + 1, unary[nodes, labels].sum() + pairs.sum())
    return DecodingAnswer(labels, Status.STOPPED)


register_decoder("annealing", anneal)

# %%
# The check compares its labellings with all labellings of small problems, with ties, forbidden
# labels, and potentials of 1e-12 to 1e12.
print(check_decoder("annealing", n_problems=60))

# %%
# A grid of 8 x 8 nodes with three labels, which ``exact`` can still solve.
rng = np.random.default_rng(3)
grid = LabelGraph.from_lattice((8, 8))
hard = Potentials(rng.normal(size=(64, 3)), pairwise=rng.normal(size=(grid.n_edges, 3, 3)))
found = {name: decode(grid, hard, name) for name in ("icm", "trw-s", "annealing", "exact")}
best = found["exact"].score
for name, labeling in found.items():
    print(f"{name:10} {labeling.score:8.3f}  {100 * labeling.score / best:5.1f} %  {labeling}")

# %%
# The record of each sweep is in ``info["history"]``.
figure, axis = plt.subplots(figsize=(8, 4.2), layout="constrained")
history = found["annealing"].info["history"]
axis.plot(np.arange(1, len(history) + 1), history, color="#2b4bb8", lw=2, label="annealing")
axis.axhline(best, color="#2d2d2d", ls="--", lw=1)
axis.annotate("the best of all", (1, best), (1, best + 1.5), color="#2d2d2d")
for name, colour in {"trw-s": "#a6336c", "icm": "#e0a11b"}.items():
    axis.axhline(found[name].score, color=colour, lw=1.5, label=name)
axis.set(xlabel="sweep", ylabel="score", ylim=(None, best + 6))
axis.legend(loc="lower right", frameon=False)
