"""
A sentence: letters behind noise
================================

A text arrives letter by letter, each as a picture so noisy that every third is misread.
Which letters follow each other is no secret of this text, though: a hidden Markov model counts a
table of 27 x 27 transitions in other texts, and the most probable sentence needs no dictionary.
The texts are the descriptions that scikit-learn ships with its data sets.
"""

import re
import string

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from sklearn import datasets
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler
from pgm_places.models.hmm import HiddenMarkovModel

letters, rng = [*string.ascii_lowercase, " "], np.random.default_rng(4)
font = ImageFont.load_default(size=13)


def drawn(letter):
    """A letter as 8 x 6 grey values."""
    page = Image.new("L", (12, 16), 0)
    ImageDraw.Draw(page).text((6, 8), letter, fill=255, font=font, anchor="mm")
    return np.asarray(page, float).reshape(8, 2, 6, 2).mean(axis=(1, 3)) / 255


glyphs = np.stack([drawn(letter) for letter in letters])


def lines(load, length=60):
    """A description as lines of letters and spaces."""
    text = re.sub("[^a-z]+", " ", load().DESCR.lower())
    return [text[k : k + length] for k in range(0, len(text) - length, length)]


def problem(line):
    """A chain of noisy pictures, and what they were drawn from."""
    truth = np.array([letters.index(letter) for letter in line])
    looks = glyphs[truth] + rng.normal(scale=0.32, size=(len(truth), 8, 6))
    graph = LabelGraph.from_lattice((len(truth),))
    return LabelingProblem(graph, letters, node_features=looks.reshape(len(truth), -1)), truth


books = [datasets.load_wine, datasets.load_diabetes, datasets.load_breast_cancer]
train = [problem(line) for load in books for line in lines(load)]
test = [problem(line) for line in lines(datasets.load_iris)]
print(f"{60 * len(train)} letters to learn from, {60 * len(test)} to read")

# %%
# The filter knows the letters so far and could read along; the most probable path knows them all.
problems, truths = zip(*train, strict=True)
unread, wanted = zip(*test, strict=True)
models = {
    "letter by letter": "independent",
    "letters so far": HiddenMarkovModel("filter"),
    "whole line": HiddenMarkovModel("viterbi"),
}
found = {}
for name, backend in models.items():
    model = StructuredLabeler(backend, LinearDiscriminantAnalysis(), n_folds=3)
    model.fit(problems, truths)
    found[name] = model.predict(unread)
    rate = np.mean(np.hstack(found[name]) == np.hstack(wanted))
    print(f"{name:16} {100 * rate:.1f} % of the letters")


def words(labels):
    return "".join(letters[label] for label in labels)


for line in (3, 4, 5):
    print(*(words(row[line]) for row in (wanted, *found.values())), "", sep="\n")

# %%
# The table, as how much more often a letter follows than it occurs at large: u after q, say.
figure, axes = plt.subplots(2, 1, figsize=(9, 9.4), height_ratios=[1, 5], layout="constrained")
strip = np.hstack(unread[4].node_features.reshape(-1, 8, 6)[:30])
axes[0].imshow(strip, cmap="gray_r", vmin=-0.6, vmax=1.2, extent=(0, 360, 16, 0))
read = {"true": wanted[4], **{name: rows[4] for name, rows in found.items()}}
for n, (name, row) in enumerate(read.items()):
    for k, label in enumerate(row[:30]):
        colour = "#2d2d2d" if label == wanted[4][k] else "#d1002c"
        axes[0].text(12 * k + 6, 26 + 13 * n, letters[label], ha="center", color=colour)
    axes[0].text(-4, 26 + 13 * n, name, ha="right", fontsize=9)
axes[0].set(ylim=(70, 0), xlim=(-75, 360))
axes[0].set_axis_off()
share = np.bincount(np.hstack(truths), minlength=27) / len(np.hstack(truths))
table = np.log2(model.backend_.transition / share).clip(-4, 4)
names = ["␣" if letter == " " else letter for letter in letters]
picture = axes[1].imshow(table, cmap="PuOr_r", vmin=-4, vmax=4)
axes[1].set_xticks(range(27), names)
axes[1].set_yticks(range(27), names)
axes[1].set(xlabel="next letter", ylabel="letter")
figure.colorbar(picture, ax=axes[1], label="times two to the power of", shrink=0.8)
