"""A right call of every public function, constructor and method, for tests that spoil a part."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import pgm_places as p
from pgm_places import simulation
from pgm_places.graph.cliques import Cliques
from pgm_places.topology.rules import CorrectionRules
from tests.labelers.test_contract import CASES, NAMES, known, walk
from tests.right_labeler_calls import labeler_calls


class RightCall(NamedTuple):
    """A call that is answered: its name, what is called, and the arguments by name."""

    name: str
    function: Callable[..., Any]
    arguments: dict[str, Any]


class Things(NamedTuple):
    """One of everything that the package hands out, small."""

    file: Any
    grid: p.OccupancyGrid
    known: p.LabelledMap
    drive: p.Trajectory
    mapped: p.MappedDrive
    scan: p.Scan
    places: p.PlaceLabeler
    steps: p.TrajectoryLabeler
    structured: p.StructuredLabeler
    found: Any
    topology: Any
    graph: p.LabelGraph
    problem: p.LabelingProblem
    potentials: p.Potentials
    labeling: p.Labeling
    method: Any


def things(folder: Path) -> Things:
    """Made once a test; the files lie in a folder."""
    item, drive = known(0), walk(0)[:6]
    p.save_map(item.grid, folder / "map")
    p.save_labels(folder / "labels.png", item.labels, NAMES)
    places = CASES["places"].fit(CASES["places"].labeler(), 0)
    steps = CASES["trajectories"].fit(CASES["trajectories"].labeler(), 0)
    structured = CASES["structured"].fit(CASES["structured"].labeler(), 0)
    p.save(places, folder / "model")
    found = p.label_map(places, item.grid)
    topology = p.topological_map(item.grid, item.labels, NAMES)
    p.save_topology(folder / "topology", topology)
    graph = p.LabelGraph.from_edges(3, [(0, 1), (1, 2)], positions_m=np.eye(3)[:, :2])
    graph = graph.with_cliques(Cliques.of([[0, 1]], 3))
    unary = np.array([[0.0, 1.0], [0.5, 0.0], [0.0, 0.2]])
    geometry = p.ScanGeometry.full_circle(8, range_max_m=5.0)
    return Things(
        p.load_map(folder / "map.yaml"),
        item.grid,
        item,
        drive,
        p.MappedDrive(item, drive),
        p.Scan(0.0, np.zeros(3), np.ones(8, np.float32), geometry),
        places,
        steps,
        structured,
        found,
        topology,
        graph,
        p.LabelingProblem(graph, NAMES, unary=unary, known=np.array([-1, 0, -1])),
        p.Potentials.potts(unary, 0.5),
        p.decode(graph, p.Potentials.potts(unary, 0.5), "sum-product"),
        p.build("potts"),
    )


def right_calls(t: Things, folder: Path) -> list[RightCall]:
    """Every public function, constructor and method with every parameter that has one meaning."""
    masks = np.ones(t.grid.shape, np.bool_)
    n_free = int(t.grid.free.sum())
    node_labels = np.array([0, 1, 0])
    unary, edges = t.potentials.unary, [(0, 1), (1, 2)]
    geometry, names = t.scan.geometry, list(NAMES)
    layout = t.found.layout
    poses = np.zeros((3, 3))
    prob = np.full((3, 2), 0.5)
    shift = p.Similarity(0.1)
    quick = {"n_threads": 1, "progress": None}

    calls = {
        "load_map": (
            p.load_map,
            {"path": folder / "map.yaml", "compat": "nav2", "unknown_value": None}
            | {"max_pixels": 10**6},
        ),
        "save_map": (
            p.save_map,
            {"grid": t.grid, "stem": folder / "new", "image_format": "png"},
        ),
        "load_labels": (
            p.load_labels,
            {"image_path": folder / "labels.png", "label_names": names, "grid": t.grid}
            | {"names_path": folder / "labels.yaml", "classes": {"room": "room", "*": "corridor"}},
        ),
        "save_labels": (
            p.save_labels,
            {"path": folder / "new_labels.png", "raster": t.known.labels, "label_names": names},
        ),
        "save_topology": (
            p.save_topology,
            {"folder": folder / "new_topology", "topology": t.topology},
        ),
        "load_topology": (
            p.load_topology,
            {"folder": folder / "topology", "max_pixels": 10**6},
        ),
        "save": (
            p.save,
            {"item": t.places, "folder": folder / "new_model", "label_names": (), "record": {}},
        ),
        "load": (p.load, {"folder": folder / "model"}),
        "trained_labeler": (p.trained_labeler, {"name": "default"}),
        "trained_tracker": (p.trained_tracker, {"name": "tracking"}),
        "label_map": (
            p.label_map,
            {"labeler": t.places, "grid": t.grid, "method": "potts", "known": t.known.labels}
            | {"features_of": None, "max_cells": 10**6, **quick},
        ),
        "topological_map": (
            p.topological_map,
            {"grid": t.grid, "labels": t.known.labels, "label_names": names}
            | {"rules": CorrectionRules(), "correct": True, "beliefs": np.full((n_free, 2), 0.5)}
            | {"layout": layout, "known": None, "own_names": {1: "lab"}, "tolerance": 1.5}
            | {"min_width_m": 0.0, "doorways": None},
        ),
        "places_to_check": (p.places_to_check, {"topology": t.topology}),
        "evaluate": (
            p.evaluate,
            {"truth": [0, 1, -1], "predicted": node_labels, "label_names": names}
            | {"beliefs": prob},
        ),
        "generate_building": (
            simulation.generate_building,
            {"size": "small", "style": "office", "seed": 0},
        ),
        # ---------------------------------------------------------------- records
        "OccupancyGrid": (
            p.OccupancyGrid,
            {"cells": [[0, 100], [-1, 0]], "resolution_m": 0.5, "origin_xy_m": (0.0, 1.0)}
            | {"yaw_rad": 0.5},
        ),
        "OccupancyGrid.cell_centres_m": (t.grid.cell_centres_m, {"cells_rc": [[0, 1]]}),
        "OccupancyGrid.cells_at_m": (t.grid.cells_at_m, {"positions_m": [[0.0, 1.0]]}),
        "OccupancyGrid.points_at_m": (t.grid.points_at_m, {"positions_m": [[0.0, 1.0]]}),
        "OccupancyGrid.with_cells": (t.grid.with_cells, {"cells": t.grid.cells}),
        "LabelledMap": (
            p.LabelledMap,
            {"grid": t.grid, "labels": t.known.labels, "window": masks, "name": "a"}
            | {"building": "b", "domain": "drawn"},
        ),
        "LabelledMap.graph": (t.known.graph, {"connectivity": 8, "labelled_only": True}),
        "LabelledMap.truth": (t.known.truth, {"graph": t.known.graph()}),
        "MappedDrive": (p.MappedDrive, {"map": t.known, "drive": t.drive}),
        "Trajectory": (
            p.Trajectory,
            {"times_s": np.arange(3.0), "poses": poses, "ranges_m": np.ones((3, 8))}
            | {"geometry": geometry, "labels": node_labels, "label_names": NAMES}
            | {"odometry": poses, "name": "a", "building": "b"},
        ),
        "Trajectory.from_scans": (p.Trajectory.from_scans, {"scans": [t.scan], "name": "a"}),
        "Trajectory.labelled_by": (
            t.drive.labelled_by,
            {"labelled_map": t.known, "label_names": NAMES},
        ),
        "Trajectory.relabelled": (
            t.drive.relabelled,
            {"new_names": {"room": "room", "corridor": "room"}, "label_names": ["room"]},
        ),
        "Trajectory.resampled": (t.drive.resampled, {"every_m": 0.3}),
        "Trajectory.scan": (p.Trajectory.from_scans([t.scan]).scan, {"step": 0}),
        "Trajectory.subset": (t.drive.subset, {"steps": [0, 2]}),
        "Trajectory.transformed": (t.drive.transformed, {"similarity": shift}),
        "Trajectory.with_labels": (
            t.drive.with_labels,
            {"labels": np.zeros(6, np.int64), "label_names": ["room"]},
        ),
        "Trajectory.with_scans": (
            t.drive.with_scans,
            {"ranges_m": np.ones((6, 8)), "geometry": geometry},
        ),
        "Trajectory.within": (p.Trajectory.from_scans([t.scan]).within, {"range_max_m": 2.0}),
        "Scan": (
            p.Scan,
            {"time_s": 0.0, "pose": np.zeros(3), "ranges_m": np.ones(8), "geometry": geometry}
            | {"odometry": np.zeros(3)},
        ),
        "ScanGeometry": (
            p.ScanGeometry,
            {"angles_rad": [0.0, 0.1], "range_max_m": 5.0, "range_min_m": 0.0},
        ),
        "ScanGeometry.ahead": (
            p.ScanGeometry.ahead,
            {"n_beams": 5, "view_rad": 1.0, "range_max_m": 5.0},
        ),
        "ScanGeometry.full_circle": (
            p.ScanGeometry.full_circle,
            {"n_beams": 5, "range_max_m": 5.0, "range_min_m": 0.1},
        ),
        "ScanGeometry.half_circle": (
            p.ScanGeometry.half_circle,
            {"n_beams": 5, "range_max_m": 5.0, "range_min_m": 0.1},
        ),
        "ScanGeometry.cleaned": (geometry.cleaned, {"readings_m": np.ones((2, 8))}),
        "ScanGeometry.returned": (geometry.returned, {"ranges_m": np.ones((2, 8))}),
        "ScanGeometry.same_as": (geometry.same_as, {"other": geometry}),
        "Sensor": (
            p.Sensor,
            {"n_beams": 8, "max_range_m": 5.0, "stop_at_unknown": True}
            | {"noise": p.SensorNoise()},
        ),
        "SensorNoise": (
            p.SensorNoise,
            {"sigma_m": 0.1, "p_random": 0.1, "p_max": 0.1, "seed": 1},
        ),
        "Similarity": (
            p.Similarity,
            {"rotation_rad": 0.1, "translation_m": (1.0, 2.0), "scale": 1.0},
        ),
        "Similarity.from_points": (
            p.Similarity.from_points,
            {"positions_m": np.eye(2), "seen_at_m": 2 * np.eye(2)},
        ),
        "Similarity.of_poses": (shift.of_poses, {"poses": poses}),
        "Similarity.of_positions": (shift.of_positions, {"positions_m": np.eye(2)}),
        # ---------------------------------------------------------------- problems
        "LabelGraph.from_edges": (
            p.LabelGraph.from_edges,
            {"n_nodes": 3, "edges": edges, "edge_kind": [0, 1], "positions_m": np.eye(3)[:, :2]}
            | {"layout": None},
        ),
        "LabelGraph.from_grid": (
            p.LabelGraph.from_grid,
            {"grid": t.grid, "connectivity": 8, "mask": masks},
        ),
        "LabelGraph.from_lattice": (
            p.LabelGraph.from_lattice,
            {"nodes": (3, 2), "diagonals": True},
        ),
        "LabelGraph.from_networkx": (
            p.LabelGraph.from_networkx,
            {"graph": t.graph.to_networkx(), "nodelist": [2, 1, 0], "position": "pos"},
        ),
        "LabelGraph.from_points": (
            p.LabelGraph.from_points,
            {"points": np.eye(3), "n_neighbours": 1},
        ),
        "LabelGraph.from_sparse": (
            p.LabelGraph.from_sparse,
            {"matrix": _sparse(), "positions_m": np.eye(2)},
        ),
        "LabelGraph.from_trajectory": (
            p.LabelGraph.from_trajectory,
            {"positions_m": np.eye(3)[:, :2], "loops": [(0, 2)]},
        ),
        "LabelGraph.joined": (
            p.LabelGraph.joined,
            {"first": t.graph, "second": t.graph, "links": [(0, 1)]},
        ),
        "LabelGraph.edge_order": (t.graph.edge_order, {"pairs": edges}),
        "LabelGraph.edge_values": (
            t.graph.edge_values,
            {"values": {(0, 1): 1.0}, "default": 0.0},
        ),
        "LabelGraph.node_values": (t.graph.node_values, {"values": {0: 1.0}, "default": 0.0}),
        "LabelGraph.subgraph": (t.graph.subgraph, {"nodes": [True, False, True]}),
        "LabelGraph.with_cliques": (t.graph.with_cliques, {"cliques": t.graph.cliques}),
        "LabelingProblem": (
            p.LabelingProblem,
            {"graph": t.graph, "label_names": names, "unary": unary, "node_features": unary}
            | {"edge_features": np.ones((2, 1)), "known": [-1, 0, -1]}
            | {"cliques": t.graph.cliques, "clique_features": np.ones((1, 1))},
        ),
        "LabelingProblem.from_probabilities": (
            p.LabelingProblem.from_probabilities,
            {"graph": t.graph, "label_names": names, "probabilities": prob}
            | {"node_features": unary, "edge_features": np.ones((2, 1)), "known": [-1, 0, -1]},
        ),
        "LabelingProblem.describe": (t.problem.describe, {"labels": node_labels}),
        "LabelingProblem.subproblem": (t.problem.subproblem, {"nodes": [True, False, True]}),
        "LabelingProblem.with_evidence": (t.problem.with_evidence, {"scores": unary}),
        "LabelingProblem.with_unary": (t.problem.with_unary, {"unary": unary}),
        "Potentials": (
            p.Potentials,
            {"unary": unary, "pairwise": np.eye(2), "agreement": None},
        ),
        "Potentials.potts": (p.Potentials.potts, {"unary": unary, "weight": 0.5}),
        "Potentials.by_distance": (
            p.Potentials.by_distance,
            {"unary": unary, "weight": 0.5, "power": 2, "cap": 1.0},
        ),
        "Potentials.check_fits": (t.potentials.check_fits, {"graph": t.graph}),
        "Potentials.edge_tables": (t.potentials.edge_tables, {"graph": t.graph}),
        "Potentials.with_known": (t.potentials.with_known, {"known": [-1, 0, 1]}),
        "Labeling": (
            p.Labeling,
            {"labels": node_labels, "status": p.Status.EXACT, "beliefs": prob, "score": 1.0}
            | {"bound": 1.0, "info": {"a": 1}},
        ),
        "Labeling.is_optimal": (t.labeling.is_optimal, {"tolerance": 0.5}),
        "Labeling.check": (
            t.labeling.check,
            {"problem": t.problem, "potentials": t.potentials},
        ),
        "Labeling.part": (t.labeling.part, {"nodes": np.array([0, 2])}),
        "score": (
            p.score,
            {"graph": t.graph, "potentials": t.potentials, "labels": node_labels},
        ),
        "decode": (
            p.decode,
            {"graph": t.graph, "potentials": t.potentials, "method": "trw-s"}
            | {"known": [-1, 0, 1], "certify": True, "max_iterations": 5}
            | {"on_iteration": lambda step, value: None, "inside": True, "decoder": None},
        ),
        "build": (lambda **a: p.build(a["name"], a["options"]), {"name": "potts", "options": {}}),
        "potts.infer": (t.method.infer, {"problem": t.problem}),
        "amn.fit": (
            p.build("amn").fit,
            {"problems": [t.problem], "labelings": [[1, 0, 1]]},
        ),
        **labeler_calls(t),
    }
    return [RightCall(name, function, given) for name, (function, given) in calls.items()]


def _sparse() -> Any:
    from scipy.sparse import csr_array

    return csr_array(np.array([[0.0, 1.0], [1.0, 0.0]]))


def first_error(call: RightCall, **changed: Any) -> Exception | None:
    """What a call raises with some arguments changed; None where it is answered."""
    try:
        call.function(**{**call.arguments, **changed})
    except Exception as error:  # noqa: BLE001  which is what the tests look at
        return error
    return None
