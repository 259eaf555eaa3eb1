"""Rectangles of a map's cells."""

from dataclasses import dataclass

__all__ = ["Box"]


@dataclass(frozen=True)
class Box:
    """Rows ``bottom`` to ``top`` and columns ``left`` to ``right`` of a map, the ends excluded."""

    bottom: int
    top: int
    left: int
    right: int

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.top - self.bottom

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.right - self.left

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the box in the map's array."""
        return slice(self.bottom, self.top), slice(self.left, self.right)

    def grown(self, margin: int, shape: tuple[int, int]) -> "Box":
        """The box with ``margin`` more cells on all sides, as far as the map goes."""
        return Box(
            max(self.bottom - margin, 0),
            min(self.top + margin, shape[0]),
            max(self.left - margin, 0),
            min(self.right + margin, shape[1]),
        )
