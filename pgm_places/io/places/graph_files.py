"""The topological graph for graph tools: GraphML, node-link JSON and DOT."""

import io
import json
from pathlib import Path

from pgm_places.errors import printable
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["write_dot", "write_graphml", "write_node_link"]


def write_graphml(path: Path | str, topology: TopologicalMap) -> Path:
    """Write ``topology.graph`` as GraphML, for yEd, Gephi and networkx; the path."""
    import networkx as nx

    graph = topology.graph.copy()
    for values in graph.nodes.values():  # XML cannot hold control characters, not even escaped
        values.update({key: printable(values[key]) for key in ("name", "label")})
    buffer = io.BytesIO()
    nx.write_graphml_xml(graph, buffer, named_key_ids=True)
    return write_bytes(path, buffer.getvalue())


def write_node_link(path: Path | str, topology: TopologicalMap) -> Path:
    """Write ``topology.graph`` as node-link JSON, for networkx and d3; the path.

    The lists are named ``nodes`` and ``edges``.
    """
    graph = topology.graph
    content = {
        "directed": False,
        "multigraph": False,
        "graph": {},
        "nodes": [{**values, "id": number} for number, values in graph.nodes.items()],
        "edges": [{**v, "source": a, "target": b} for a, b, v in graph.edges(data=True)],
    }
    return write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def write_dot(path: Path | str, topology: TopologicalMap) -> Path:
    """Write ``topology.graph`` for Graphviz; positions are metres, kept by ``neato -n2``."""
    lines = ["graph places {"]
    for region in topology.regions:
        shape = "box" if region.label == topology.doorway_label else "ellipse"
        x, y = region.anchor_m
        lines.append(
            f'  {region.id} [label="{_quoted(region.name)}", class="{_quoted(region.label)}", '
            f'shape={shape}, pos="{72 * x:.2f},{72 * y:.2f}"];'
        )
    lines += [
        f'  {item.first} -- {item.second} [label="{item.width_m:.2f} m"];'
        for item in topology.connections
    ]
    return write_text(path, "\n".join([*lines, "}"]) + "\n")


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
