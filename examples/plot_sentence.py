"""
A sentence: letters behind noise
================================

A text arrives letter by letter, each as a picture so noisy that every third is misread. A hidden
Markov model counts a table of 27 x 27 transitions between letters in other texts, and finds the
most probable sentence without a dictionary. The texts are the descriptions of scikit-learn's data
sets.
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
# The filter uses the letters so far; the most probable path uses all letters.
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

# %%
# Half of the first three lines, as they arrive and as they are labelled; wrong letters are red.
figure, axes = plt.subplots(3, 1, figsize=(9, 6.3), layout="constrained")
for line, axis in enumerate(axes):
    strip = np.hstack(unread[line].node_features.reshape(-1, 8, 6)[:30])
    axis.imshow(strip, cmap="gray_r", vmin=-0.6, vmax=1.2, extent=(0, 360, 18, 0))
    read = {"true": wanted[line], **{name: rows[line] for name, rows in found.items()}}
    for n, (name, row) in enumerate(read.items()):
        for k, label in enumerate(row[:30]):
            colour = "#2d2d2d" if label == wanted[line][k] else "#d1002c"
            axis.text(12 * k + 6, 30 + 14 * n, letters[label], ha="center", color=colour)
        axis.text(-4, 30 + 14 * n, name, ha="right", fontsize=9)
    axis.set(ylim=(76, 0), xlim=(-75, 360))
    axis.set_axis_off()

# %%
# The table, with the most frequent letters: after h comes e, and words end in d, s or f.
share = np.bincount(np.hstack(truths), minlength=27)
often = np.sort(np.argsort(-share)[:18])
names = ["␣" if letters[label] == " " else letters[label] for label in often]
figure, axis = plt.subplots(figsize=(7, 5.6), layout="constrained")
table = model.backend_.transition[np.ix_(often, often)]
picture = axis.imshow(table, cmap="Blues", vmin=0, vmax=0.5)
axis.set_xticks(range(len(often)), names)
axis.set_yticks(range(len(often)), names)
axis.set(xlabel="next letter", ylabel="letter")
axis.tick_params(length=0)
axis.spines[:].set_visible(False)
figure.colorbar(picture, label="probability", shrink=0.8)
