"""The fixtures of these tests."""

from stand_in import node_module, ros

__all__ = ["node_module", "ros"]
