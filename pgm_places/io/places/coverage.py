"""Export for opennav_coverage: polygons of places in which a cleaning robot's centre may be."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from pgm_places.errors import InputError
from pgm_places.io.atomic import write_text
from pgm_places.maps.clearance import squared_clearance
from pgm_places.maps.components import connected_components
from pgm_places.topology.outlines import outlines
from pgm_places.topology.topological_map import TopologicalMap

GOALS, SCRIPT = "coverage.yaml", "cover_place.py"

_CELLS_OF_MARGIN = np.sqrt(2)
"""Half the diagonal of a free cell plus half that of an obstacle's cell, in cells."""

_SCRIPT = '''\
#!/usr/bin/env python3
"""Sends a place of coverage.yaml to Nav2's coverage navigator: cover_place.py "room 3"."""

import sys
from pathlib import Path

import rclpy
import yaml
from geometry_msgs.msg import Point32, Polygon
from opennav_coverage_msgs.action import NavigateCompleteCoverage
from rclpy.action import ActionClient


def main():
    places = yaml.safe_load((Path(__file__).parent / "coverage.yaml").read_text())["places"]
    if len(sys.argv) != 2 or sys.argv[1] not in places:
        sys.exit("usage: cover_place.py PLACE, one of: " + ", ".join(places))
    place = places[sys.argv[1]]
    rclpy.init()
    node = rclpy.create_node("cover_place")
    client = ActionClient(node, NavigateCompleteCoverage, "navigate_complete_coverage")
    client.wait_for_server()
    goal = NavigateCompleteCoverage.Goal(frame_id=place["frame_id"])
    for ring in place["polygons"]:
        goal.polygons.append(Polygon(points=[Point32(x=x, y=y, z=0.0) for x, y in ring]))
    accepted = client.send_goal_async(goal)
    rclpy.spin_until_future_complete(node, accepted)
    if not accepted.result().accepted:
        sys.exit("the coverage navigator rejected the goal")
    result = accepted.result().get_result_async()
    rclpy.spin_until_future_complete(node, result)
    sys.exit(result.result().result.error_code)


if __name__ == "__main__":
    main()
'''


def coverage_goals(topology: TopologicalMap, robot_radius_m: float) -> dict[str, Any]:
    """The goal of opennav_coverage's ``NavigateCompleteCoverage`` for each place.

    The first polygon is the outline of the largest part of the place in which a disc of the
    robot's radius touches nothing but other places; the others are obstacles in it. All points are
    at least the radius from obstacles. Rings are closed, as Fields2Cover wants them.

    Parameters
    ----------
    topology : TopologicalMap
    robot_radius_m : float

    Returns
    -------
    dict
        ``places``: by name, ``frame_id`` and ``polygons``, lists of [x, y] in metres.
        ``left_out``: names of places too small for the robot; doorways are in neither.

    Raises
    ------
    InputError
        The robot fits into no place.
    """
    grid = topology.grid
    clear = squared_clearance(topology.region == 0)
    free = clear >= (robot_radius_m / grid.resolution_m + _CELLS_OF_MARGIN) ** 2
    places: dict[str, Any] = {}
    left_out = []
    for region in topology.regions:
        if region.label == topology.doorway_label:
            continue
        window = topology.window(region.id)
        inside = free[window] & (topology.region[window] == region.id)
        if not inside.any():
            left_out.append(region.name)
            continue
        largest = connected_components(inside, connectivity=4).largest
        piece = np.where(largest, 0, -1).astype(np.int32)
        [outline] = outlines(piece, 1, tolerance=0)
        corner = np.array([window[0].start, window[1].start])
        rings = [grid.cell_centres_m(ring + corner - 0.5) for ring in outline.polygons[0]]
        polygons = [ring.round(3).tolist() for ring in rings]
        places[region.name] = {"frame_id": "map", "polygons": polygons}
    if not places:
        raise InputError(
            f"a robot with a radius of {robot_radius_m:g} m fits into no place; pass a smaller "
            "--robot-radius"
        )
    return {"places": places, "left_out": left_out}


def write_coverage(folder: Path, topology: TopologicalMap, robot_radius_m: float) -> list[Path]:
    """Write the goals of all places and a script that sends one of them; returns the paths."""
    goals = coverage_goals(topology, robot_radius_m)
    text = yaml.safe_dump(goals, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return [write_text(folder / GOALS, text), write_text(folder / SCRIPT, _SCRIPT)]
