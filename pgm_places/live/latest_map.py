"""LatestMap: the map as it is now: the last that came, with the updates since."""

from typing import Any

import numpy as np

from pgm_places.errors import InputError
from pgm_places.live.ros_codec import RosCodec


class LatestMap:
    """Keeps the last ``nav_msgs/OccupancyGrid`` and applies ``map_msgs/OccupancyGridUpdate``s.

    An update is a rectangle of cells that replaces those of the map. Maps are neither looked into
    nor copied until an update comes.

    Parameters
    ----------
    codec : RosCodec
    frame : str
        The frame that maps must be in; those that name none are taken.
    """

    def __init__(self, codec: RosCodec, frame: str) -> None:
        self._codec, self._frame = codec, frame
        self._raw: bytes | None = None
        self._message: Any = None

    def take(self, raw: bytes) -> None:
        """A map has come.

        Raises
        ------
        InputError
            It is in another frame. The one before stays.
        """
        try:
            message = self._codec.read(raw, "map")
        except InputError:
            pass  # labelling it will say so
        else:
            self._check_frame(message)
        self._raw, self._message = raw, None

    def update(self, raw: bytes) -> None:
        """A part of the map has changed.

        Raises
        ------
        InputError
            It cannot be read, is in another frame, or is no part of the map.
        """
        update = self._codec.read(raw, "map_updates")
        self._check_frame(update)
        if self._message is None:
            if self._raw is None:
                raise InputError("an update of the map came before the map, and is dropped")
            message = self._codec.read(self._raw, "map")
            message.data = np.array(message.data)  # those of the bytes cannot be written to
            self._message, self._raw = message, None
        info = self._message.info
        rows, columns = (
            slice(first, first + number)
            for first, number in ((update.y, update.height), (update.x, update.width))
        )
        fits = 0 <= rows.start <= rows.stop <= info.height
        fits = fits and 0 <= columns.start <= columns.stop <= info.width
        is_whole = len(self._message.data) == info.height * info.width
        if not (fits and is_whole) or len(update.data) != update.height * update.width:
            raise InputError(
                f"an update of {update.width} x {update.height} cells at ({update.x}, {update.y}) "
                f"with {len(update.data)} values is no part of the map of {info.width} x "
                f"{info.height} cells, and is dropped; check its publisher"
            )
        cells = self._message.data.reshape(info.height, info.width)
        cells[rows, columns] = np.reshape(update.data, (update.height, update.width))

    def raw(self) -> bytes:
        """The bytes of the map as it is now."""
        if self._raw is None:
            self._raw, self._message = self._codec.write(self._message, "map"), None
        return self._raw

    def _check_frame(self, message: Any) -> None:
        frame = str(message.header.frame_id).lstrip("/")
        if frame not in ("", self._frame.lstrip("/")):
            raise InputError(
                f"the map is in the frame {frame!r}, but positions are looked up in "
                f"{self._frame!r}: it is not used (map_frame)"
            )
