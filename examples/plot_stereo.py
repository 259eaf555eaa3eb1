"""
Stereo: how far away is each pixel?
===================================

In two pictures from cameras next to each other, near objects shift more than distant ones. The
shift is the label of a pixel: 24 ordered labels. Neighbours pay a price that grows with their
difference up to a limit, because objects have edges. TRW-S finds a labelling and an upper bound of
all scores; their gap limits what another labelling could gain under this model.
"""

import time

import matplotlib.pyplot as plt
import numpy as np
from scipy import ndimage as ndi
from skimage import data
from skimage.transform import downscale_local_mean

from pgm_places import LabelGraph, Potentials, decode

scale, n_labels = 6, 24
left, right, disparity = data.stereo_motorcycle()
left, right = (downscale_local_mean(image / 255, (scale, scale, 1)) for image in (left, right))
rows, columns = np.arange(disparity.shape[0] // scale), np.arange(disparity.shape[1] // scale)
truth = disparity[scale // 2 :: scale, scale // 2 :: scale][: len(rows), : len(columns)] / scale
left, right = left[: len(rows), : len(columns)], right[: len(rows), : len(columns)]
shifts = np.linspace(0.5, 12, n_labels)

# %%
# The price of a label at a pixel is the difference of the shifted picture in a small window, up to
# a limit, since an object may be hidden from one camera.
at_row, at_column = np.meshgrid(rows, columns, indexing="ij")
cost = np.empty((len(rows), len(columns), n_labels))
for label, shift in enumerate(shifts):
    where = [at_row, at_column - shift]
    seen = [ndi.map_coordinates(right[..., c], where, order=1, mode="nearest") for c in range(3)]
    difference = np.abs(left - np.stack(seen, axis=-1)).mean(axis=-1)
    cost[..., label] = ndi.uniform_filter(np.minimum(difference, 0.15), 3)
graph = LabelGraph.from_lattice(cost.shape[:2])
unary = -60 * cost.reshape(-1, n_labels)

# %%
# Neighbours: half a unit for each step between their labels, at most two, and twice as much where
# the picture has no edge.
grey = left.mean(axis=-1).ravel()
alike = np.abs(grey[graph.edges[:, 0]] - grey[graph.edges[:, 1]]) < 0.04
weight = np.where(alike, 2.0, 1.0)
potentials = Potentials.by_distance(unary, 0.5 * weight, cap=2.0 * weight)
found = {"each pixel": unary.argmax(axis=1)}
for name, options in {"icm": {}, "trw-s": {"max_iterations": 40}}.items():
    start = time.perf_counter()
    labeling = decode(graph, potentials, name, **options)
    found[name] = labeling.labels
    print(f"{name:6} score {labeling.score:9.1f}  {time.perf_counter() - start:4.1f} s")
print(
    f"trw-s: nothing scores above {labeling.bound:.1f}; {labeling.gap / -labeling.score:.2%} left"
)

measured = np.isfinite(truth) & (truth > 0.5)
for name, labels in found.items():
    error = np.abs(shifts[labels].reshape(truth.shape) - truth)[measured]
    print(f"{name:10} {100 * np.mean(error > 1):4.1f} % of the pixels are off by more than a pixel")

# %%
figure, axes = plt.subplots(2, 3, figsize=(11, 5.2), layout="constrained")
axes = axes.ravel()
axes[0].imshow(left)
axes[0].set_title("left picture")
truth = np.where(measured, truth, np.nan)
shown = {"measured": truth} | {n: shifts[found[n]].reshape(truth.shape) for n in found}
for axis, (name, picture) in zip(axes[1:], shown.items(), strict=False):
    drawn = axis.imshow(picture, cmap="cividis", vmin=0, vmax=12)
    axis.set_title(name)
for axis in axes:
    axis.set_axis_off()
figure.colorbar(drawn, ax=axes, fraction=0.03, label="shift, pixels")
