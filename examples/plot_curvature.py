"""
Factors of order three: a series with slopes
============================================

A chain of pairs rewards equal neighbours in time, so every slope becomes a staircase.
A factor over three steps rewards a constant slope.
The chain of these factors is still narrow enough to be solved exactly.
"""

import matplotlib.pyplot as plt
import numpy as np

from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.models.factor_decoding import decode_factors

rng = np.random.default_rng(2)
n_steps, levels = 90, np.linspace(-1.2, 1.2, 25)
truth = np.interp(np.arange(n_steps), [0, 22, 40, 62, 89], [-0.8, 0.9, 0.9, -0.6, 0.2])
signal = truth + rng.normal(scale=0.25, size=n_steps)

# %%
# Labels are levels. Pairs pay for the distance of their levels, triples for the change of slope, up
# to a cap that allows breaks.
unary = -((signal[:, None] - levels) ** 2) / (2 * 0.25**2)
k = np.arange(len(levels))
jump = -0.35 * np.minimum(np.abs(k[:, None] - k), 12)
bend = -0.9 * np.minimum(np.abs(k[:, None, None] - 2 * k[:, None] + k), 6)
steps = [(t,) for t in range(n_steps)]
chains = {
    "pairs": [(jump, (t, t + 1)) for t in range(n_steps - 1)],
    "triples": [(bend, (t, t + 1, t + 2)) for t in range(n_steps - 2)],
}
found = {}
for name, factors in chains.items():
    graph = FactorGraph.of(
        np.full(n_steps, len(levels)),
        [*steps, *(scope for _, scope in factors)],
        [*unary, *(table for table, _ in factors)],
    )
    labeling = decode_factors(graph, "exact")
    found[name] = levels[labeling.labels]
    error = np.abs(found[name] - truth).mean()
    width = labeling.info["width"]
    print(f"{name:8} {labeling.status}, width {width}: mean error {error:.3f}")

# %%
# The beliefs of the triples show the uncertainty of each step.
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True, layout="constrained")
axes[0].plot(signal, ".", color="#9aa3ad", label="measured")
axes[0].plot(truth, "--", color="#2d2d2d", lw=1, label="truth")
axes[0].plot(found["pairs"], color="#e0a11b", lw=2, drawstyle="steps-mid", label="pairs")
axes[0].plot(found["triples"], color="#2b4bb8", lw=2, label="triples")
axes[0].set(xlabel="step", ylabel="level")
axes[0].legend(frameon=False)
image = axes[1].imshow(
    labeling.beliefs.T,
    origin="lower",
    aspect="auto",
    cmap="Blues",
    extent=(0, n_steps, levels[0], levels[-1]),
)
axes[1].plot(np.arange(n_steps) + 0.5, truth, "--", color="#2d2d2d", lw=1)
axes[1].set(xlabel="step", title="probability of each level, from triples")
figure.colorbar(image, ax=axes[1])
