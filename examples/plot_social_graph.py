"""
A social graph: who sides with whom?
====================================

A karate club broke apart over a quarrel between its instructor and an officer. Only the sides of
these two are known. The Potts field chooses a side for every other member such that as little
contact as possible is cut; with two labels this is a minimum cut, so the result is optimal.
W. W. Zachary recorded how often each pair met, and the side that each member took.
"""

import matplotlib.pyplot as plt
import networkx as nx
import numpy as np

from pgm_places import LabelGraph, LabelingProblem, Potentials, build, decode

club = nx.karate_club_graph()
graph = LabelGraph.from_networkx(club)
ties = graph.edge_values(nx.get_edge_attributes(club, "weight"))
truth = (graph.node_values(nx.get_node_attributes(club, "club")) == "Officer").astype(int)
names, known = ("instructor", "officer"), np.full(graph.n_nodes, -1)
known[0], known[33] = 0, 1

# %%
# ``edge_weights = "given"`` multiplies the weight of each tie by how often the two have met.
problem = LabelingProblem(graph, names, edge_features=ties[:, None], known=known)
labeling = build("potts", {"edge_weights": "given"}).infer(problem)
wrong = np.flatnonzero(labeling.labels != truth)
print(f"{labeling.status}, gap {labeling.gap:.1g}; wrong: {wrong.tolist()} of {graph.n_nodes}")

# %%
# The uncertainty: marginals of the model, approximated by belief propagation.
potentials = Potentials(np.zeros((graph.n_nodes, 2)), agreement=0.25 * np.stack([ties, ties], 1))
beliefs = decode(graph, potentials, "sum-product", known=known).beliefs
doubt = np.argsort(np.abs(beliefs[:, 1] - 0.5))[:3]
for member in doubt:
    side = names[truth[member]]
    print(f"member {member}: {beliefs[member, 1]:.2f} for the officer, went with the {side}")

# %%
# Yellow and blue are the two sides, grey is uncertain; a red rim is an error.
figure, axis = plt.subplots(figsize=(9, 5), layout="constrained")
at = nx.spring_layout(club, seed=3, weight=None)
shades = plt.get_cmap("cividis_r")(beliefs[:, 1])
rims = np.where(labeling.labels == truth, "#5a6472", "#d1002c")
nx.draw_networkx_edges(club, at, ax=axis, width=list(0.35 * ties), edge_color="#9aa3ad")
nx.draw_networkx_nodes(club, at, ax=axis, node_color=shades, edgecolors=list(rims),
                       node_size=list(np.where(known >= 0, 520, 230)), linewidths=2)  # fmt: skip
scale = plt.cm.ScalarMappable(cmap="cividis_r")
figure.colorbar(scale, ax=axis, label="chance to side with the officer", shrink=0.7)
axis.set_axis_off()
