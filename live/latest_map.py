"""LatestMap: the last received map with all later updates."""

from typing import Any

import numpy as np

from pgm_places.errors import InputError
from pgm_places.live.ros_codec import RosCodec


class LatestMap:
    """Stores the last ``nav_msgs/OccupancyGrid`` and applies ``map_msgs/OccupancyGridUpdate``s.

    An update is a rectangle of cells that replaces cells of the map. A map is neither decoded nor
    copied until an update comes. Maps must be in ``frame``, or without a frame.
    """

    def __init__(self, codec: RosCodec, frame: str) -> None:
        self._codec, self._frame = codec, frame
        self._raw: bytes | None = None
        self._message: Any = None

    def take(self, raw: bytes) -> None:
        """Replace the map."""
        try:
            message = self._codec.read(raw, "map")
        except InputError:
            pass  # labelling reports the error
        else:
            self._check_frame(message)
        self._raw, self._message = raw, None

    def update(self, raw: bytes) -> None:
        """Apply an update of a part of the map."""
        update = self._codec.read(raw, "map_updates")
        self._check_frame(update)
        if self._message is None:
            if self._raw is None:
                raise InputError("an update of the map came before the map, and is dropped")
            message = self._codec.read(self._raw, "map")
            message.data = np.array(message.data)  # arrays on the message's bytes are read-only
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
        """The bytes of the updated map."""
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
