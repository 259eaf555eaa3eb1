"""
A UAI file: what is wrong with this patient?
============================================

Many programs read the files of the UAI competitions. This one is the chest clinic of Lauritzen and
Spiegelhalter (1988), known as Asia: eight nodes, a table for each node given its causes, and a
cycle. The network is solved exactly, first without and then with observed symptoms.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pgm_places.io.uai import read_evidence, read_uai, read_uai_result, write_uai_result
from pgm_places.models.factor_decoding import decode_factors

folder = Path(tempfile.mkdtemp())
(folder / "asia.uai").write_text(
    "BAYES 8  2 2 2 2 2 2 2 2  8 "
    "1 0  1 1  2 0 2  2 1 3  2 1 4  3 2 3 5  2 5 6  3 4 5 7 "
    "2  .99 .01   2  .5 .5   4  .99 .01 .95 .05   4  .99 .01 .9 .1   4  .7 .3 .4 .6 "
    "8  1 0 0 1 0 1 0 1   4  .95 .05 .02 .98   8  .9 .1 .3 .7 .2 .8 .1 .9\n"
)
names = ["visit to Asia", "smokes", "tuberculosis", "lung cancer", "bronchitis"]
names += ["one of the two", "dark X-ray", "short of breath"]
network = read_uai(folder / "asia.uai")

# %%
# Evidence is a file, too: the number of known nodes, then each node with its label.
cases = {"nothing known": "0", "short of breath": "1 7 1", "... and a dark X-ray": "2 7 1 6 1"}
cases["... and was in Asia"] = "3 7 1 6 1 0 1"
chances = {}
for case, text in cases.items():
    (folder / "asia.uai.evid").write_text(text)
    known = read_evidence(folder / "asia.uai.evid", network.n_nodes)
    found = decode_factors(network, "exact", known=known)
    chances[case] = found.beliefs[:, 1]
    likely = [names[node] for node in np.flatnonzero(found.labels) if known[node] < 0]
    print(f"{case:20} {found.status}; most probable: {', '.join(likely) or 'healthy'}")

# %%
# The answer goes into a file that other programs read.
path = write_uai_result(folder / "asia.uai.MAR", found, "MAR", graph=network)
print(path.read_text())
print(read_uai_result(path).beliefs[2])

figure, axis = plt.subplots(figsize=(9, 4.4), layout="constrained")
colours = ["#9aa3ad", "#e0a11b", "#2b4bb8", "#a6336c"]
place = np.arange(5)
for n, ((case, chance), colour) in enumerate(zip(chances.items(), colours, strict=True)):
    axis.bar(place + 0.2 * (n - 1.5), chance[:5], width=0.18, color=colour, label=case)
axis.set_xticks(place, names[:5])
axis.set(ylim=(0, 1), ylabel="probability")
axis.legend(frameon=False)
