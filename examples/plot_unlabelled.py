"""
A series without labels: calm and storm
=======================================

The two states of this signal have equal means and differ in spread and duration. No step is
labelled. Expectation maximisation alternates between a Gaussian for each state with the transitions
between states, and the probability of each state at each step, which is exact on a chain. A mixture
of single steps is the comparison.
"""

import matplotlib.pyplot as plt
import numpy as np
from pgm_places_plugins.gaussian_em import gaussian_em
from sklearn.mixture import GaussianMixture

from pgm_places import LabelGraph, decode

rng = np.random.default_rng(7)
truth = np.repeat([0, 1, 0, 1, 0, 1, 0], [120, 70, 90, 40, 130, 100, 50])
n_steps = len(truth)
signal = rng.normal(size=n_steps) * np.where(truth, 1.6, 0.5)
features = signal[:, None]

# %%
# Learning begins twice: at clusters of the signal, which are useless here, and at clusters of its
# mean and spread around each step. No round lowers the objective; the better result is taken.
chain = LabelGraph.from_lattice((n_steps,))
found = gaussian_em([chain], [features], 2)
deviation = np.sqrt(found.covariances[:, 0, 0])
storm = int(deviation.argmax())
print(f"{len(found.objectives) - 1} rounds, converged: {found.converged}")
print("standard deviations", deviation.round(2), "(true ones 0.5 and 1.6)")
print("a state goes on with probability", np.diag(found.transition).round(3))

# %%
# What was learned labels this series, and any other, with any decoder.
best = decode(chain, found.potentials(chain, features), "exact")
mixture = GaussianMixture(2, random_state=0).fit(features)
wide = int(mixture.covariances_[:, 0, 0].argmax())
alone = mixture.predict(features) == wide
for name, labels in {"each step alone": alone, "chain": best.labels == storm}.items():
    print(f"{name:16} {100 * (labels == truth).mean():5.1f} % right")

figure, axes = plt.subplots(2, 1, figsize=(10, 5), sharex=True, layout="constrained",
                            height_ratios=[3, 1])  # fmt: skip
axes[0].plot(signal, color="#2d2d2d", lw=0.7)
low, high = signal.min(), signal.max()
axes[0].fill_between(np.arange(n_steps), low, high, where=best.labels == storm, color="#2b4bb8",
                     alpha=0.2, lw=0, label="storm, as found")  # fmt: skip
axes[0].set(ylabel="signal", xlim=(0, n_steps), ylim=(low, high))
axes[0].legend(loc="upper left", frameon=False)
axes[1].plot(found.beliefs[0][:, storm], color="#2b4bb8", label="found")
axes[1].plot(truth, color="#2d2d2d", ls="--", lw=1, label="truth")
axes[1].set(ylim=(-0.05, 1.05), xlabel="step", ylabel="chance of storm")
axes[1].legend(loc="upper left", ncols=2, frameon=True)
