"""The kinds of edges."""

from enum import IntEnum


class EdgeKind(IntEnum):
    """The kind of an edge; models may treat kinds differently."""

    AXIS = 0
    """Two cells that share a side."""
    DIAGONAL = 1
    """Two cells that share a corner."""
    TIME = 2
    """Two steps that follow each other."""
    LINK = 3
    """Nodes of two joined graphs."""
    LOOP = 4
    """Two steps at one location on different passes."""
