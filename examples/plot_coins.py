"""
An image: which pixels are coins?
=================================

The coins lie on an unevenly lit background, so no threshold separates them, and a classifier that
looks at one pixel at a time leaves holes and specks.
An associative Markov network learns on the left half of the picture how strongly similar
neighbours should agree, and labels the right half.
The ground truth is the segmentation from scikit-image's own tutorial (watershed on the gradient).
"""

import time

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from scipy import ndimage as ndi
from skimage import data, filters, segmentation
from sklearn.linear_model import LogisticRegression

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, evaluate

image = data.coins()
seeds = np.where(image < 30, 1, np.where(image > 150, 2, 0))
coins = ndi.binary_fill_holes(segmentation.watershed(filters.sobel(image), seeds) == 2)
image, coins = image[::2, ::2] / 255, coins[::2, ::2].astype(int)

# %%
# A graph over the pixels; features are brightness at three scales, its gradient and contrast.
smooth = [ndi.gaussian_filter(image, sigma) for sigma in (0, 1, 3)]
looks = np.stack([*smooth, filters.sobel(image), np.abs(image - smooth[2])], axis=-1)
names, middle = ["background", "coin"], image.shape[1] // 2


def problem(part):
    graph = LabelGraph.from_lattice(part.shape[:2], diagonals=True)
    return LabelingProblem(graph, names, node_features=part.reshape(-1, part.shape[-1]))


train, test = problem(looks[:, :middle]), problem(looks[:, middle:])
truth = coins[:, middle:]

# %%
# The same classifier alone and in front of the network; ``certify`` adds a proof of optimality.
found, rows = {}, []
for name, backend in [("pixel by pixel", "independent"), ("learned AMN", "amn")]:
    model = StructuredLabeler(backend, LogisticRegression())
    if backend == "amn":
        model.set_params(backend__edge_features=("constant", "raw-difference"))
        model.set_params(backend__certify=True)
    model.fit([train], [coins[:, :middle].ravel()])
    start = time.perf_counter()
    labeling = model.label(test)
    found[name] = labeling.labels.reshape(truth.shape)
    proof = f"{labeling.status}, gap {labeling.gap:.1g}"
    rows.append((name, time.perf_counter() - start, proof))

sure = np.exp(model.scores(test)[:, 1]).reshape(truth.shape)
start = time.perf_counter()
walk = segmentation.random_walker(image[:, middle:], 1 * (sure < 0.1) + 2 * (sure > 0.9), tol=1e-5)
found["random walker"] = walk - 1
rows.append(("random walker", time.perf_counter() - start, "no proof"))

for name, seconds, proof in rows:
    accuracy = evaluate(truth.ravel(), found[name].ravel(), names).accuracy
    print(f"{name:15} {100 * accuracy:5.1f} %  {seconds:5.2f} s  {proof}")

# %%
# Misclassified pixels are red.
figure, axes = plt.subplots(1, 5, figsize=(13, 4.6), layout="constrained")
axes[0].imshow(image[:, middle:], cmap="gray")
for axis, (name, labels) in zip(axes[1:], {"truth": truth, **found}.items(), strict=True):
    axis.imshow(labels, cmap=ListedColormap(["#dcdcdc", "#2b4bb8"]))
    axis.imshow(np.ma.masked_equal(labels != truth, 0), cmap=ListedColormap(["#d1002c"]))
    axis.set_title(name)
for axis in axes:
    axis.set_axis_off()
