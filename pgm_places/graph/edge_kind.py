"""The kinds of edges."""

from enum import IntEnum


class EdgeKind(IntEnum):
    """What an edge stands for; models may treat kinds differently."""

    AXIS = 0
    """Two cells that share a side."""
    DIAGONAL = 1
    """Two cells that share a corner."""
    TIME = 2
    """Two steps that follow each other."""
    LINK = 3
    """Nodes of two graphs that were joined."""
    LOOP = 4
    """Two steps at one spot on different passes."""
