"""
A time series: when did it change?
==================================

A signal stays at one level for a while and jumps to another; noise and outliers hide the jumps.
Levels are labels. Neighbours in time that differ pay a price that does not depend on the distance
of their levels, so the signal is flat between its jumps. A time series is a chain, on which the
best labelling and all probabilities are exact.
"""

import matplotlib.pyplot as plt
import numpy as np

from pgm_places import LabelGraph, Potentials, decode
from pgm_places.models.sampling import sample

rng = np.random.default_rng(5)
n_steps, levels = 400, np.linspace(-2, 2, 81)
jumps = np.array([55, 92, 160, 228, 240, 318])
truth = np.repeat([0.1, 1.2, -0.4, 0.9, -1.3, -0.3, 0.4], np.diff([0, *jumps, n_steps]))
signal = truth + rng.normal(scale=0.45, size=n_steps)
outliers = rng.random(n_steps) < 0.04
signal[outliers] += rng.normal(scale=3.0, size=outliers.sum())

# %%
# A measurement is normal noise around a level, or an outlier that says little about it.
graph = LabelGraph.from_lattice((n_steps,))
error = (signal[:, None] - levels) / 0.45
unary = np.logaddexp(np.log(0.96) - error**2 / 2, np.log(0.04 * 0.15) - (error * 0.15) ** 2 / 2)
potentials = Potentials.potts(unary, weight=8.0)
best = decode(graph, potentials, "exact")
found = np.flatnonzero(np.diff(best.labels)) + 1
print(f"{best.status}: {len(found)} jumps at {found.tolist()}; true ones at {jumps.tolist()}")

# %%
# Samples of labellings show the alternatives: how often is there a jump at each step?
drawn = sample(graph, potentials, 2000, seed=0)
jumped = np.diff(drawn.labels, axis=1) != 0
chance = jumped.mean(axis=0)
low, high = np.quantile(jumped.sum(axis=1), [0.05, 0.95]).astype(int)
print(f"exact samples: {drawn.exact}; nine of ten have {low} to {high} jumps")
for jump in jumps:
    near = jumped[:, jump - 4 : jump + 3].any(axis=1).mean()
    print(f"a jump within three steps of {jump}: {near:.2f}")

# %%
# For comparison, a running median as wide as the shortest level allows.
padded = np.pad(signal, 5, mode="edge")
median = np.median(np.lib.stride_tricks.sliding_window_view(padded, 11), axis=1)
for name, values in {"running median": median, "chain": levels[best.labels]}.items():
    print(f"{name:15} mean error {np.abs(values - truth).mean():.3f}")

figure, axes = plt.subplots(2, 1, figsize=(10, 5.6), sharex=True, layout="constrained",
                            height_ratios=[3, 1])  # fmt: skip
axes[0].plot(signal, ".", color="#9aa3ad", markersize=4, label="measured")
axes[0].plot(truth, color="#2d2d2d", lw=1, ls="--", drawstyle="steps-post", label="true level")
axes[0].plot(median, color="#e0a11b", lw=1.2, label="running median")
axes[0].plot(levels[best.labels], color="#2b4bb8", lw=2.2, drawstyle="steps-post", label="chain")
axes[0].set(ylim=(-3, 3), ylabel="level", xlim=(0, n_steps))
axes[0].legend(loc="upper right", ncols=4, frameon=False)
axes[1].bar(np.arange(1, n_steps), chance, width=1.6, color="#a6336c")
axes[1].plot(jumps, np.full(len(jumps), 1.05), "kv", clip_on=False)
axes[1].set(ylim=(0, 1), xlabel="step", ylabel="chance of a jump")
