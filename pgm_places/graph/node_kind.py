"""The kinds of nodes."""

from enum import IntEnum

__all__ = ["NodeKind"]


class NodeKind(IntEnum):
    """What a node stands for, in graphs that have nodes of several kinds."""

    CELL = 0
    """A cell of a map."""
    GATE = 1
    """A gate between two places."""
    PLACE = 2
    """A place: many cells together."""
