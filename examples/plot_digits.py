"""
A chain: a handwritten counter
==============================

A counter stays at one digit for some steps and then moves on to the next. Each digit is a real
handwritten one with added noise, and the labels form a chain.
A hidden Markov model learns from labelled chains which digit follows which. A conditional random
field also learns how much the pictures count. An associative network learns only that digits
tend to repeat.
hmmlearn cannot be trained on labels, so it receives a Gaussian per digit and these transitions.
"""

import time

import matplotlib.pyplot as plt
import numpy as np
from hmmlearn.hmm import GaussianHMM
from sklearn.datasets import load_digits
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler
from pgm_places.models.hmm import HiddenMarkovModel

rng = np.random.default_rng(3)
pictures, digits = load_digits(return_X_y=True)
names = [str(digit) for digit in range(10)]


def chain(examples, n_steps=150):
    """A counter's digits, each with a noisy picture drawn from the examples."""
    truth = np.cumsum(rng.random(n_steps) < 0.25) % 10
    looks = np.stack([pictures[rng.choice(examples[digits[examples] == d])] for d in truth])
    looks = looks + rng.normal(scale=6.0, size=looks.shape)
    return LabelingProblem(LabelGraph.from_lattice((n_steps,)), names, node_features=looks), truth


examples = rng.permutation(len(digits))
train = [chain(examples[:900]) for _ in range(12)]
test = [chain(examples[900:]) for _ in range(6)]  # digits not seen in training

# %%
# One classifier, and five ways to use its scores.
classifier = make_pipeline(StandardScaler(), LogisticRegression(C=0.01))
models = {
    "digit by digit": "independent",
    "AMN on the chain": "amn",
    "CRF, learned table": "crf",
    "HMM, online": HiddenMarkovModel("filter", "posterior"),
    "HMM, most probable path": HiddenMarkovModel("viterbi", "posterior"),
}
found = {}
problems, truths = zip(*test, strict=True)
for name, backend in models.items():
    model = StructuredLabeler(backend, classifier).fit(*zip(*train, strict=True))
    model.predict(problems[:1])  # imports what it needs
    start = time.perf_counter()
    found[name] = model.predict(problems), time.perf_counter() - start

other = GaussianHMM(10, "diag", init_params="")
other.startprob_, other.transmat_ = np.full(10, 0.1), model.backend_.transition
steps, known = np.vstack([p.node_features for p, _ in train]), np.hstack([y for _, y in train])
other.means_ = np.array([steps[known == d].mean(axis=0) for d in range(10)])
other.covars_ = np.array([steps[known == d].var(axis=0) for d in range(10)])
start = time.perf_counter()
labels = [other.predict(problem.node_features) for problem in problems]
found["hmmlearn, Gaussian"] = labels, time.perf_counter() - start

for name, (labels, seconds) in found.items():
    accuracy = np.mean(np.hstack(labels) == np.hstack(truths))
    print(f"{name:24} {100 * accuracy:5.1f} %  {1000 * seconds:6.1f} ms")

# %%
# The first test chain; crosses mark errors.
figure, axes = plt.subplots(7, 1, figsize=(10, 8.5), sharex=True, sharey=True, layout="constrained")
axes[0].plot(test[0][1], drawstyle="steps-mid", color="#2d2d2d")
axes[0].set_title("truth", loc="left")
for axis, (name, (chains, _)) in zip(axes[1:], found.items(), strict=True):
    labels, wrong = chains[0], chains[0] != test[0][1]
    axis.plot(labels, drawstyle="steps-mid", color="#2b6cb0")
    axis.plot(np.flatnonzero(wrong), labels[wrong], "x", color="#d1002c")
    axis.set_title(f"{name}: {wrong.sum()} wrong", loc="left")
axes[-1].set_xlabel("step")
