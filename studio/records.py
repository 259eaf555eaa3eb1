"""Records for the browser: the state of a session as plain data."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.maps.coarsening import Coarsening
from pgm_places.studio.layers import GROUNDS, TILE, value_colours
from pgm_places.studio.session import MapSession
from pgm_places.teaching.explanation import explain_cell
from pgm_places.teaching.interactive_labeler import InteractiveResult
from pgm_places.teaching.reasons import FeatureVote
from pgm_places.topology.checks import PlaceCheck
from pgm_places.topology.topological_map import TopologicalMap, gate_record

MOST_CHECKS = 200
LEAST_M2 = 0.05
"""Least uncertain area of a place to check (m²): a smaller one would be displayed as 0.0 m²."""

MOST_PATH_POINTS = 20_000
PLACE_KEYS = ("id", "name", "label", "is_likely_hall", "anchor_m", "box_m")
"""The record of a place to check."""


def state_record(session: MapSession) -> dict[str, Any]:
    """The state of the session, apart from pictures and places."""
    grid, painting, relabelling = session.grid, session.painting, session.relabelling
    own = () if session.labeler is None else session.labeler.label_names_
    return {
        "tick": session.tick,
        "map": {
            "name": session.source.name,
            "rows": grid.shape[0],
            "columns": grid.shape[1],
            "resolution_m": grid.resolution_m,
            "origin_m": list(grid.origin_xy_m),
            "yaw_rad": grid.yaw_rad,
            "tile": TILE,
            "levels": session.layers.n_levels,
            "box": list(session.box),
        },
        "classes": [
            {**asdict(item), "own": k < len(own), "fixed": k < session.n_fixed}
            for k, item in enumerate(painting.classes.items)
        ],
        "next_colour": painting.classes.next_colour,
        "painted": painting.n_painted,
        **{name: getattr(painting, name) for name in ("revision", "can_undo", "can_redo")},
        "versions": [asdict(item) for item in painting.versions],
        "learns": session.learns,
        "learner": asdict(session.learner.state),
        "relabelling": None
        if relabelling is None
        else {
            "number": session.n_relabellings,
            "revision": relabelling.revision,
            "method": relabelling.taught.labelled.method,
            "seconds": relabelling.taught.seconds,
            "known": relabelling.class_of.tolist(),
            "warnings": list(relabelling.taught.labelled.warnings),
            "changed": ""
            if session.changes is None
            else session.changes.words(painting.classes.names),
            "agrees": session.agrees,
        },
        "sources": session.layers.sources,
        "drive": session.drive_xy_m is not None,
        "gradients": {
            theme: {name: value_colours(name, theme)[::32] for name in ("entropy", "probability")}
            for theme in GROUNDS
        },
        "notices": _notices(session),
        "model": session.model if session.labeler is not None else None,
    }


def _notices(session: MapSession) -> list[str]:
    notices = [
        f"{file.path.name} was changed on the disk. End the studio and start it again."
        for file in session.files
        if file.was_changed()
    ]
    if session.migration is not None:
        notices.append(session.migration.message)
    if session.ids_notice:
        notices.append(f"{session.ids_notice[0].upper()}{session.ids_notice[1:]}.")
    if session.painting.journal.was_changed():
        notices.append(
            "Another program changed the journal; edits are not saved. Restart the studio."
        )
    return notices


def places_record(taught: InteractiveResult) -> dict[str, Any]:
    """Regions with outlines, gates, connections, and the places to check first."""
    topology = taught.topology
    features = {item["id"]: item for item in topology.to_geojson()["features"]}
    regions = []
    for region in topology.regions:
        item = features[region.id]
        geometry = item["geometry"]
        polygons = geometry["coordinates"]
        regions.append(
            {
                **item["properties"],
                "polygons": [polygons] if geometry["type"] == "Polygon" else polygons,
                "probabilities": region.probabilities,
            }
        )
    return {
        "regions": regions,
        "gates": [
            {**gate_record(gate), "probability": round(probability, 4)}
            for gate, probability in taught.gates
        ],
        "connections": [asdict(item) for item in topology.connections],
        "checks": [
            {
                **{name: getattr(check.place, name) for name in PLACE_KEYS},
                "doubt": check.doubt,
                "doubtful_m2": check.doubtful_m2,
                "second_label": _second_label(check, topology),
            }
            for check in taught.open_checks[:MOST_CHECKS]
            if min(check.place.area_m2, check.doubtful_m2) >= LEAST_M2
        ],
    }


def _second_label(check: PlaceCheck, topology: TopologicalMap) -> str | None:
    """The second most probable label of a place; a place between doorways is no doorway itself."""
    door, place = topology.doorway_label, check.place
    if check.second_label != door or place.label == door:
        return check.second_label
    known = zip(topology.label_names, place.probabilities or (), strict=False)
    others = {name: share for name, share in known if name not in (door, place.label)}
    return max(others, key=lambda name: others[name]) if any(others.values()) else None


def cell_record(session: MapSession, x: float, y: float) -> dict[str, Any]:
    """The labels and probabilities of the cell at a point (x, y in cells)."""
    grid = session.grid
    column, row = int(np.floor(x)), int(np.floor(y))
    [[x_m, y_m]] = grid.cell_centres_m([[y - 0.5, x - 0.5]]).tolist()
    record: dict[str, Any] = {"x_m": x_m, "y_m": y_m, "ground": "outside"}
    if not (0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]):
        return record
    names = session.painting.classes.names
    record["ground"] = {0: "free", 100: "wall"}.get(int(grid.cells[row, column]), "unknown")
    record["paint"] = _name(names, int(session.painting.labels[row, column]))
    if session.layers.truth is not None:
        record["truth"] = _name(names, int(session.layers.truth[row, column]))
    relabelling, taught = session.relabelling, session.taught
    if relabelling is None or taught is None:
        return record
    record["label"] = _name(names, int(relabelling.labels[row, column]))
    record["unary"] = _name(names, int(relabelling.unary_labels[row, column]))
    region = int(taught.topology.region[row, column])
    record["region"] = region or None
    for key, found in (("probabilities", taught.labelled), ("unary_probabilities", taught.unary)):
        record[key] = _beliefs(found, taught.label_names, row, column)
    hall, node = taught.labelled.hall, _node(taught.labelled, row, column)
    if hall is not None and node >= 0:
        record["hall"] = round(float(hall[node]), 4)
    return record


def drive_record(session: MapSession) -> dict[str, Any]:
    """The path of the drive in metres, subsampled if it is long."""
    path = session.drive_xy_m
    if path is None:
        return {"path_m": []}
    step = max(1, len(path) // MOST_PATH_POINTS)
    return {"path_m": path[::step].round(3).tolist()}


def _name(names: tuple[str, ...], label: int) -> str | None:
    return names[label] if 0 <= label < len(names) else None


def _beliefs(
    found: LabelledPlaces, names: Sequence[str], row: int, column: int
) -> dict[str, float] | None:
    beliefs, node = found.labeling.beliefs, _node(found, row, column)
    if beliefs is None or node < 0:
        return None
    shares = zip(names, beliefs[node].tolist(), strict=True)
    return {name: round(value, 4) for name, value in shares}


def _node(found: LabelledPlaces, row: int, column: int) -> int:
    """The node behind a cell, -1 for none."""
    cell = Coarsening.behind(found.layout, found.grid).holders(np.array([[row, column]]))
    return int(found.layout.nodes_at(cell)[0])


MOST_VOTES = 4
"""Most votes of each sign, for each class."""
MOST_BEAMS = 180
QUESTION_KEYS = ("label", "log_odds", "from_scan", "from_spaces")
GATE_KEYS = ("painted", "gate_probability", "gate_log_odds", "networks", "doorway_log_odds")


def reasons_record(taught: InteractiveResult, x_m: float, y_m: float) -> dict[str, Any]:
    """The scan of the cell at a position, the votes for each class, its gate and its neighbours."""
    found = explain_cell(taught, x_m, y_m)
    step = -(-len(found.ranges_m) // MOST_BEAMS)
    ranges, angles = found.ranges_m[::step], found.angles_rad[::step]
    ends = np.stack([x_m + ranges * np.cos(angles), y_m + ranges * np.sin(angles)], axis=1)
    return {
        "scan_m": ends.round(3).tolist(),
        "questions": [
            {
                **{name: getattr(question, name) for name in QUESTION_KEYS},
                "votes": [
                    {**asdict(vote), "unit": vote.unit} for vote in _strongest(question.votes)
                ],
            }
            for question in found.questions
        ],
        **{name: getattr(found, name) for name in GATE_KEYS},
        "pulls": [
            {"at_m": [pull.x_m, pull.y_m], "label": pull.label, "towards": pull.towards}
            for pull in found.neighbours
        ],
    }


def _strongest(votes: tuple[FeatureVote, ...]) -> list[FeatureVote]:
    """The strongest votes, first for and then against the class."""
    signs = ([v for v in votes if v.log_odds > 0], [v for v in votes if v.log_odds < 0])
    return [vote for same in signs for vote in same[:MOST_VOTES]]
