"""What a live node publishes: topics and how they are kept."""

from typing import NamedTuple

from pgm_places.live.map_labeller import SHOWN


class Output(NamedTuple):
    """How something is published.

    Parameters
    ----------
    topic : str
        Below the output namespace, but for those that begin with a slash.
    is_kept : bool
        Whether those who come later get the last message.
    depth : int
        How many messages wait to be sent.
    """

    topic: str
    is_kept: bool
    depth: int


OUTPUTS = {
    "place": Output("place", is_kept=False, depth=10),
    "current_place": Output("current_place", is_kept=False, depth=10),
    "diagnostics": Output("/diagnostics", is_kept=False, depth=10),
    **{what: Output(what, is_kept=True, depth=1) for what in SHOWN},
}
"""All that is published, reliably; the types are in ``ros_codec.TYPES``."""
