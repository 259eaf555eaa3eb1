"""
Superpixels: which texture is where?
====================================

A picture is cut into some hundred superpixels, which are labelled instead of pixels. The picture
is a mosaic of three photographs of ground, so the truth is known: grass, gravel and brick, all of
equal brightness and contrast, so that only texture distinguishes them.
The graph joins superpixels that share a border, and the length of that border is a feature of the
edge; an associative Markov network learns how much it counts.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy import ndimage as ndi
from skimage import data, segmentation
from skimage.feature import local_binary_pattern
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler

names, side = ["grass", "gravel", "brick"], 256
grounds = [getattr(data, name)().astype(float) for name in names]
grounds = [(ground - ground.mean()) / ground.std() for ground in grounds]


def mosaic(seed, corner):
    """Blobs of three textures, cut out of one quarter of each photograph."""
    rng = np.random.default_rng(seed)
    fields = [ndi.gaussian_filter(rng.normal(size=(side, side)), 26) for _ in names]
    truth = np.argmax(fields, axis=0)
    row, column = corner
    parts = [ground[row : row + side, column : column + side] for ground in grounds]
    picture = np.choose(truth, parts) + rng.normal(scale=0.7, size=truth.shape)
    return picture, truth


def problem(picture, truth):
    """Superpixels as nodes: statistics inside, shared borders between."""
    smooth = ndi.gaussian_filter(picture, 2)
    pieces = segmentation.slic(smooth, n_segments=320, compactness=0.4, channel_axis=None) - 1
    n_pieces = pieces.max() + 1
    codes = local_binary_pattern(np.uint8(np.clip(40 * picture + 128, 0, 255)), 8, 2, "uniform")
    layers = [codes == code for code in range(10)]
    layers += [ndi.gaussian_gradient_magnitude(picture, scale) for scale in (1, 2, 4)]
    looks = np.stack([ndi.mean(layer, pieces, np.arange(n_pieces)) for layer in layers], axis=1)
    beside = [(pieces[:, :-1], pieces[:, 1:]), (pieces[:-1], pieces[1:])]
    pairs = np.concatenate([np.stack(pair, axis=-1).reshape(-1, 2) for pair in beside])
    pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
    edges, border = np.unique(pairs, axis=0, return_counts=True)
    graph = LabelGraph.from_edges(n_pieces, edges)
    shared = border[:, None] / border.mean()
    votes = np.stack([np.bincount(pieces[truth == k], minlength=n_pieces) for k in range(3)])
    made = LabelingProblem(graph, names, node_features=looks, edge_features=shared)
    return made, votes.argmax(axis=0), pieces


train = [mosaic(seed, (0, 0)) for seed in range(4)]
test_picture, test_truth = mosaic(9, (256, 256))
problems, labels, _ = zip(*(problem(*item) for item in train), strict=True)
test, wanted, pieces = problem(test_picture, test_truth)
print(f"{len(wanted)} superpixels with {test.graph.n_edges} borders instead of {side**2} pixels")

# %%
found = {"each superpixel": "independent", "with its neighbours": "amn"}
for name, backend in found.items():
    classifier = make_pipeline(StandardScaler(), LogisticRegression())
    model = StructuredLabeler(backend, classifier)
    if backend == "amn":
        model.set_params(backend__edge_features=("constant", "given"), backend__certify=True)
    labeling = model.fit(problems, labels).label(test)
    found[name] = labeling.labels
    right = (labeling.labels == wanted).mean()
    print(f"{name:20} {100 * right:.1f} % of the superpixels, status {labeling.status}")

# %%
palette = np.array([[109, 148, 70], [154, 163, 173], [178, 84, 60]]) / 255
figure, axes = plt.subplots(2, 2, figsize=(8, 8.4), layout="constrained")
axes = axes.ravel()
axes[0].imshow(test_picture, cmap="gray", vmin=-3, vmax=3)
axes[0].imshow(np.where(segmentation.find_boundaries(pieces)[..., None], [1, 0.85, 0, 1], 0.0))
axes[0].set_title(f"{len(wanted)} superpixels")
shown = {"truth": wanted} | found
for axis, (name, nodes) in zip(axes[1:], shown.items(), strict=True):
    axis.imshow(palette[nodes[pieces]])
    wrong = np.ma.masked_equal((nodes != wanted)[pieces], 0)
    axis.contour(wrong.filled(0), levels=[0.5], colors="#d1002c", linewidths=1.2)
    axis.set_title(name)
for name, colour in zip(names, palette, strict=True):
    axes[1].scatter([], [], color=colour, marker="s", label=name)
figure.legend(loc="outside lower center", ncols=3)
for axis in axes:
    axis.set_axis_off()
