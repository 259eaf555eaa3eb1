"""Tracking a robot scan by scan, and complete logs.

A simulated robot with a laser of 360 beams over 180 degrees drives through a generated building;
the list has 100 rounds for each of 3 labels. ``online step`` is the complete step from a raw scan
to a belief; its parts are measured separately below, with ``all 321 features`` next to the
list's own. Wall-clock milliseconds on one thread, median and 99th percentile over the scans, and
median and 99th percentile of the processor time.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from pgm_places.features.extraction import extract
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.tracking import BeliefFilter
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.local_map import LocalMap
from pgm_places.sensing.sensor import Sensor
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.trained import trained_tracker
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.unary.scan_model import BeamOptions, observed_along
from tests.on_threads import on

GEOMETRY = ScanGeometry.half_circle(360, range_max_m=80.0)
WARM_UP = 20


def timed(work: Callable[[int], object], n_scans: int) -> dict[str, float]:
    """Milliseconds of ``work(t)`` over the scans after the first few."""
    wall, processor = [], []
    for t in range(n_scans):
        started, before = time.perf_counter(), time.thread_time()
        work(t)
        wall.append(time.perf_counter() - started)
        processor.append(time.thread_time() - before)
    median, late = 1e3 * np.quantile(wall[WARM_UP:], [0.5, 0.99])
    return {
        "median ms": round(float(median), 3),
        "99 % ms": round(float(late), 3),
        "processor ms": round(1e3 * float(np.median(processor[WARM_UP:])), 3),
        "processor 99 % ms": round(1e3 * float(np.quantile(processor[WARM_UP:], 0.99)), 3),
    }


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    building = generate_building(size="small" if quick else "floor")
    names = tuple(building.label_names)
    chosen = np.random.default_rng(0).random(building.labels.shape) < (1.0 if quick else 0.1)
    known = LabelledMap(building.grid, np.where(chosen, building.labels, -1))
    places = PlaceLabeler(names, sensor=Sensor(max_range_m=12.0), space=None).fit([known])
    labeler = TrajectoryLabeler.from_places(places)
    path = SimulatedRobot(GEOMETRY).explore(building.grid, max_length_m=30.0 if quick else 120.0)
    model = labeler.scan_model_
    assert path.ranges_m is not None
    n_scans = len(path)
    scans = [path.scan(t) for t in range(n_scans)]
    sensor, angles = model.sensor, GEOMETRY.angles_rad
    local, ranges = LocalMap(), path.ranges_m
    behind = sensor.angles_rad[91:270]
    circles = observed_along(path, sensor, labeler.beams).circles_m
    columns = model.classifier.used_features
    count = len(columns)
    scores = on(1, model.log_proba, circles)
    beliefs = BeliefFilter(labeler.method_, labeler.every_m)
    parts: dict[str, Callable[[int], object]] = {}
    for beams in ("local-map", "known-map", "mirror"):
        tool = labeler.with_options(beams=BeamOptions(beams))
        online = tool.online(GEOMETRY, known_map=building.grid)
        parts[f"online step, missing beams: {beams}"] = lambda t, online=online: online.step(
            scans[t]
        )
    shipped = trained_tracker().online(GEOMETRY)
    parts["online step, the shipped model with spaces"] = lambda t: shipped.step(scans[t])
    prior = MapPrior.of_labels(building.grid, building.labels, len(names))
    observed = labeler.online(GEOMETRY, map_prior=prior)
    parts["online step, with a labelled map"] = lambda t: observed.step(scans[t])
    parts |= {
        "local map: add a scan": lambda t: local.update(
            path.poses[t], ranges[t], angles, max_range_m=80.0
        ),
        "local map: cast 179 beams": lambda t: local.cast(path.poses[t], behind, max_range_m=12.0),
        f"{count} features of the list": lambda t: on(
            1, extract, circles[t : t + 1], max_range_m=12.0, columns=columns
        ),
        "all 321 features": lambda t: on(1, extract, circles[t : t + 1], max_range_m=12.0),
        "features and list": lambda t: on(1, model.log_proba, circles[t : t + 1]),
        "filter step with its checks": lambda t: beliefs.step(
            path.poses[t, 0], path.poses[t, 1], scores[t]
        ),
    }
    rows = [
        {"part": name, "scans": n_scans, **timed(work, n_scans)} for name, work in parts.items()
    ]
    started = time.perf_counter()
    labeler.label(path, n_threads=1)
    per_scan = 1e3 * (time.perf_counter() - started) / n_scans
    log = {"part": "a whole log, per scan", "scans": n_scans, "median ms": round(per_scan, 3)}
    return [*rows, {**log, "99 % ms": None, "processor ms": None, "processor 99 % ms": None}]
