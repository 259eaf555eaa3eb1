"""Entities in text, side by side with CRFsuite.

The manual that ships with Python sets code in quotes: without the quotes, which words are code?
Each sentence is a chain of words with indicators (the word, its beginning, end and shape, its
neighbours), labelled as outside, first or further word of a piece of code. Both learn by L-BFGS
from the same indicators and minimise the same objective: with CRFsuite's ``c2 = 1``, our ``C`` is
the number of words over two, because it is the price of the mean word. F1 is of complete pieces of
code in 500 held-out sentences. Processor seconds on one thread, of the second run: of learning, and
of labelling the 500 sentences, whose features are there. Needs ``pip install python-crfsuite``.
"""

import re
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from pydoc_data.topics import topics
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.feature_extraction import DictVectorizer

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.labelers.method import label_many

NAMES = ("outside", "first", "further")
N_TEST = 500
Sentence = list[tuple[str, int]]


def sentences() -> list[Sentence]:
    """The manual's sentences as words with their labels, in a random order."""
    text = re.sub(r"\s+", " ", " ".join(topics[name] for name in sorted(topics)))
    found = []
    for sentence in re.split(r"(?<=[.?!])\s+(?=[A-Z])", text):
        words: Sentence = []
        for number, part in enumerate(sentence.split('"')):
            pieces = re.findall(r"\w+|[^\w\s]", part)
            inside = number % 2
            words += [(word, inside * (1 + (k > 0))) for k, word in enumerate(pieces)]
        if sentence.count('"') % 2 == 0 and 4 <= len(words) <= 80:
            found.append(words)
    order = np.random.default_rng(0).permutation(len(found))
    return [found[k] for k in order]


def indicators(words: Sentence, at: int) -> dict[str, float]:
    """The indicators of a word and its neighbours."""
    word = words[at][0]
    found = {
        f"word {word.lower()}": 1.0,
        f"start {word[:3]}": 1.0,
        f"end {word[-3:]}": 1.0,
        f"shape {re.sub('[0-9]', '0', re.sub('[a-z]', 'a', re.sub('[A-Z]', 'A', word)))[:6]}": 1.0,
        "has _" if "_" in word else "no _": 1.0,
    }
    for step in (-2, -1, 1, 2):
        near = words[at + step][0].lower() if 0 <= at + step < len(words) else "none"
        found[f"{step:+d} {near}"] = 1.0
    return found


def f1_of_pieces(truths: list[NDArray[np.int64]], found: list[NDArray[np.int64]]) -> float:
    """Harmonic mean of recall and precision of complete pieces."""

    def pieces(labelings: list[NDArray[np.int64]]) -> set[tuple[int, int, int]]:
        spans = set()
        for number, labels in enumerate(labelings):
            starts = [k for k, label in enumerate(labels) if label == 1]
            for start in starts:
                end = start + 1
                while end < len(labels) and labels[end] == 2:
                    end += 1
                spans.add((number, start, end))
        return spans

    true, predicted = pieces(truths), pieces(found)
    return 2 * len(true & predicted) / max(len(true) + len(predicted), 1)


def measured(work: Callable[[], Any]) -> tuple[Any, float]:
    """What it returns, and the processor seconds of its second run."""
    work()
    start = time.process_time()
    found = work()
    return found, time.process_time() - start


def ours(
    train: list[list[dict[str, float]]], truths: list[NDArray[np.int64]], test: Any
) -> tuple[list[NDArray[np.int64]], float, float]:
    """Labels of the test sentences, seconds of learning and of labelling."""
    columns = DictVectorizer().fit([word for sentence in train for word in sentence])

    def problem(sentence: list[dict[str, float]]) -> LabelingProblem:
        graph = LabelGraph.from_lattice((len(sentence),))
        return LabelingProblem(graph, NAMES, node_features=columns.transform(sentence))

    learn, asked = [problem(sentence) for sentence in train], [problem(one) for one in test]
    price = sum(len(truth) for truth in truths) / 2
    options = {"C": price, "scale": "none", "edge_scale": 1.0, "inference": "max-product"}
    field = build("crf", options)
    fitted, learning = measured(lambda: field.fit(learn, truths))
    found, labelling = measured(lambda: label_many(fitted, asked))
    return [item.labels for item in found], learning, labelling


def crfsuite(
    train: list[list[dict[str, float]]], truths: list[NDArray[np.int64]], test: Any
) -> tuple[list[NDArray[np.int64]], float, float]:
    """The same by CRFsuite."""
    import pycrfsuite

    def items(sentence: list[dict[str, float]]) -> Any:
        return pycrfsuite.ItemSequence([list(word) for word in sentence])

    trainer = pycrfsuite.Trainer(algorithm="lbfgs", verbose=False)
    trainer.set_params({"c1": 0.0, "c2": 1.0, "feature.possible_transitions": True})
    for sentence, truth in zip(train, truths, strict=True):
        trainer.append(items(sentence), [str(label) for label in truth])
    asked = [items(sentence) for sentence in test]
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "model")
        _, learning = measured(lambda: trainer.train(path))
        tagger = pycrfsuite.Tagger()
        tagger.open(path)
        found, labelling = measured(lambda: [tagger.tag(sentence) for sentence in asked])
    return [np.array([int(label) for label in labels]) for labels in found], learning, labelling


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    all_sentences = sentences()
    chosen = all_sentences[: 600 if quick else len(all_sentences)]
    described = [[indicators(words, at) for at in range(len(words))] for words in chosen]
    truths = [np.array([label for _, label in words]) for words in chosen]
    n_test = 100 if quick else N_TEST
    train, test = described[n_test:], described[:n_test]
    methods = {"ours, crf by likelihood": ours}
    if find_spec("pycrfsuite"):
        methods["CRFsuite"] = crfsuite
    rows = []
    for name, method in methods.items():
        labels, learning, labelling = method(train, truths[n_test:], test)
        rows.append(
            {
                "method": name,
                "sentences": f"{len(train):,} and {n_test}",
                "F1 %": 100 * f1_of_pieces(truths[:n_test], labels),
                "learn (s)": learning,
                "label (s)": labelling,
            }
        )
    return rows
