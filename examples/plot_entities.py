"""
Entities in text: which words are code?
=======================================

The manual that ships with Python sets code in quotes. Without the quotes, a conditional random
field finds the pieces of code: each sentence is a chain of words, indicators describe each word,
and the table of label pairs learns that a piece continues only after its beginning.
"""

import re
from pydoc_data.topics import topics

import matplotlib.pyplot as plt
import numpy as np
from sklearn.feature_extraction import DictVectorizer

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, evaluate

names = ["text", "code begins", "code goes on"]


def words_of(sentence):
    """Words and their labels; every second part between quotes is code."""
    found = []
    for number, part in enumerate(sentence.split('"')):
        pieces = re.findall(r"\w+|[^\w\s]", part)
        found += [(word, number % 2 * (1 + (k > 0))) for k, word in enumerate(pieces)]
    return found


text = re.sub(r"\s+", " ", " ".join(topics[name] for name in sorted(topics)))
sentences = re.split(r"(?<=[.?!])\s+(?=[A-Z])", text)
sentences = [words_of(s) for s in sentences if s.count('"') % 2 == 0 and 20 < len(s) < 400]
sentences = [sentences[k] for k in np.random.default_rng(0).permutation(len(sentences))]


def seen(words, at):
    """What is seen of a word: itself, its ends, its shape, its neighbours."""
    word = words[at][0]
    shape = re.sub("[a-z]", "a", re.sub("[A-Z]", "A", word))[:6]
    near = {step: at + step for step in (-2, -1, 1, 2) if 0 <= at + step < len(words)}
    around = {f"{step:+d}": words[k][0].lower() for step, k in near.items()}
    return {"word": word.lower(), "start": word[:3], "end": word[-3:], "shape": shape, **around}


looks = [[seen(words, at) for at in range(len(words))] for words in sentences]
truths = [np.array([label for _, label in words]) for words in sentences]
n_test = 300
columns = DictVectorizer().fit([word for sentence in looks[n_test:] for word in sentence])
problems = [
    LabelingProblem(LabelGraph.from_lattice((len(s),)), names, node_features=columns.transform(s))
    for s in looks
]

# %%
# All held-out sentences are labelled in one call.
labeler = StructuredLabeler("crf").set_params(backend__C=1e4)
labeler.fit(problems[n_test:], truths[n_test:])
found = labeler.predict(problems[:n_test])
result = evaluate(np.concatenate(truths[:n_test]), np.concatenate(found), names)
print(f"{result.n} words, {100 * result.accuracy:.1f} % right; F1 of labels: {result.f1}")

# %%
# Some sentences: code found is green, errors are underlined in red.
figure, axes = plt.subplots(figsize=(8, 4))
axes.axis("off")
x, y, shown = 0.0, 0, 0
for words, truth, labels in zip(sentences, truths, found, strict=False):
    if not 14 <= len(words) <= 24 or (truth > 0).sum() < 3:
        continue
    for (word, _), true, label in zip(words, truth, labels, strict=True):
        green = {"facecolor": "#c7e9c0", "edgecolor": "none", "pad": 1} if label else None
        axes.text(x, -y, word, fontsize=9, family="monospace", bbox=green)
        if label != true:
            axes.plot([x, x + 0.0128 * len(word)], [-y - 0.12] * 2, color="#cb181d", lw=1.6)
        x += 0.0128 * (len(word) + 1)
        if x > 0.95:
            x, y = 0.0, y + 1
    x, y, shown = 0.0, y + 1.5, shown + 1
    if shown == 5:
        break
axes.set(xlim=(0, 1), ylim=(-y, 1))
plt.show()
