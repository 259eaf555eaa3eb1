"""
Points in space: floor, motorcycle, garage
==========================================

A stereo camera recorded a motorcycle in a garage; each pixel with a disparity is a point in space.
The ground truth follows from the points' positions: on the floor plane, in front of the wall, or
neither.
The classifier sees only the colour and the local shape of a point's surroundings, not its position;
the network adds that nearby points belong together.
Training uses the left half, which includes the rear wheel; the right half is labelled.
"""

import time

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from scipy.spatial import cKDTree
from skimage import data
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pgm_places import LabelGraph, LabelingProblem, StructuredLabeler, evaluate

image, _, disparity = data.stereo_motorcycle()
rows, columns = (axis.ravel() for axis in np.mgrid[0:500:6, 0:741:6])
seen = np.isfinite(disparity[rows, columns]) & (disparity[rows, columns] > 0)
rows, columns = rows[seen], columns[seen]
shift, colours = disparity[rows, columns], image[rows, columns] / 255
depth = 0.193 * 994.978 / (shift + 31.086)
points = (
    np.stack([(columns - 311) * depth, (rows - 255) * depth, 994.978 * depth], axis=1) / 994.978
)

# %%
# The floor is a plane in disparity space too, fitted where it is empty; other near points stand.
plain = (rows > 340) & ((columns < 80) | (columns > 695))
flat = np.stack([rows, columns, np.ones(len(rows))], axis=1)
floor = np.abs(shift - flat @ np.linalg.lstsq(flat[plain], shift[plain])[0]) < 1.2
truth = np.where(floor, 0, np.where(shift > 33, 1, 2))
names = ["floor", "motorcycle", "garage"]


def problem(part):
    """Nearest neighbours connected; features: colour and the shape of the nearest 20 points."""
    cloud = points[part]
    near = cloud[cKDTree(cloud).query(cloud, k=20)[1]]
    around = near - near.mean(axis=1, keepdims=True)
    spread, axes = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
    looks = np.hstack([colours[part], np.log(spread + 1e-9), np.abs(axes[:, :, 0])])
    return LabelingProblem(LabelGraph.from_points(cloud), names, node_features=looks)


left, right = columns < 370, columns >= 370
train, test = problem(left), problem(right)

# %%
# The classifier alone, its log-probabilities averaged over neighbours, and the trained network.
classifier = make_pipeline(StandardScaler(), LogisticRegression())
start = time.perf_counter()
model = StructuredLabeler("amn", classifier).set_params(backend__certify=True)
model.fit([train], [truth[left]])
print(f"trained on {left.sum()} points in {time.perf_counter() - start:.1f} s")

unary, edges = model.scores(test), test.graph.edges
mean = unary.copy()
np.add.at(mean, edges.ravel(), unary[edges[:, ::-1].ravel()])
labeling = model.label(test)
found = {"point by point": unary.argmax(axis=1), "mean of neighbours": mean.argmax(axis=1)}
found["learned AMN"] = labeling.labels
for name, labels in found.items():
    result = evaluate(truth[right], labels, names)
    overlap = 100 * result.iou["motorcycle"]
    print(f"{name:20} {100 * result.accuracy:5.1f} %, overlap of the motorcycle {overlap:.0f} %")
share = labeling.gap / labeling.score
print(f"status {labeling.status}, at most {share:.1e} of its score below the best possible")

# %%
palette = ("#f4c150", "#2b4bb8", "#a1de96")
figure, panels = plt.subplots(1, 4, figsize=(12, 5.2), layout="constrained")
for panel, (name, labels) in zip(panels, {"truth": truth[right], **found}.items(), strict=True):
    picture = np.ma.masked_all((84, 124), int)
    picture[rows[right] // 6, columns[right] // 6] = labels
    panel.imshow(picture[:, 62:], cmap=ListedColormap(palette), vmin=0, vmax=2)
    panel.set_title(name)
    panel.set_axis_off()
handles = [Patch(color=colour, label=name) for colour, name in zip(palette, names, strict=True)]
figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
