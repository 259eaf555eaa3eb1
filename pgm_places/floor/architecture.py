"""Architecture of the floor network: a U-Net of five levels, for any array library."""

from collections.abc import Iterator
from typing import Any, Protocol

LABELS = ("corridor", "room", "doorway", "hall")
N_INPUTS = 10
CHANNELS = (16, 32, 48, 64, 96)
"""Channels of each level; cells of 0.2 m at the first, of 3.2 m at the last."""

DEEPEST = 2 ** (len(CHANNELS) - 1)
"""Divisor of the numbers of rows and columns."""

_LAST = len(CHANNELS) - 1
_MIDDLE = ("middle1", "middle2")


class Operations(Protocol):
    """Operations of the network on arrays (..., h, w, channels) of some library."""

    def convolution(self, x: Any, name: str, *, stride: int = 1, dilation: int = 1) -> Any:
        """Convolution with the named parameters and zero padding; the size stays, or is halved."""

    def rectified(self, x: Any) -> Any:
        """The positive part."""

    def normalised(self, x: Any, name: str) -> Any:
        """Every cell's channels over their root mean square, times a gain for each channel."""

    def enlarged(self, x: Any) -> Any:
        """Every cell as two by two."""


def parameters() -> Iterator[tuple[str, tuple[int, ...]]]:
    """Name and shape of every array of parameters, in a fixed order."""
    yield from _convolution("stem", 3, N_INPUTS, CHANNELS[0])
    for level in range(1, _LAST + 1):
        yield from _convolution(f"down{level}", 3, CHANNELS[level - 1], CHANNELS[level])
        yield from _block(f"encode{level}", CHANNELS[level])
    for name in _MIDDLE:
        yield from _block(name, CHANNELS[_LAST])
    for level in range(_LAST - 1, 0, -1):
        yield from _convolution(f"up{level}", 1, CHANNELS[level + 1], CHANNELS[level])
        yield from _block(f"decode{level}", CHANNELS[level])
    yield from _convolution("up0", 1, CHANNELS[1], CHANNELS[0])
    yield from _convolution("decode0", 3, CHANNELS[0], CHANNELS[0])
    yield from _convolution("scores", 1, CHANNELS[0], len(LABELS))


def _convolution(
    name: str, side: int, inputs: int, outputs: int
) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.weights", (side, side, inputs, outputs)
    yield f"{name}.bias", (outputs,)


def _block(name: str, channels: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.gain", (channels,)
    yield from _convolution(f"{name}.first", 3, channels, channels)
    yield from _convolution(f"{name}.second", 3, channels, channels)


def forward(x: Any, net: Operations) -> Any:
    """Scores (..., h, w, 4) of the labels from inputs (..., h, w, 10) (Ronneberger et al. 2015).

    Each level halves the raster; two dilated blocks at the deepest one cover 20 m in each
    direction.
    """
    h = net.rectified(net.convolution(x, "stem"))
    skips = [h]
    for level in range(1, _LAST + 1):
        h = net.rectified(net.convolution(h, f"down{level}", stride=2))
        h = _residual(h, f"encode{level}", net)
        skips.append(h)
    for name in _MIDDLE:
        h = _residual(h, name, net, dilation=2)
    for level in range(_LAST - 1, 0, -1):
        h = net.enlarged(net.convolution(h, f"up{level}")) + skips.pop(level)
        h = _residual(h, f"decode{level}", net)
    h = net.rectified(net.enlarged(net.convolution(h, "up0")) + skips.pop(0))
    h = h + net.rectified(net.convolution(h, "decode0"))
    return net.convolution(h, "scores")


def _residual(x: Any, name: str, net: Operations, dilation: int = 1) -> Any:
    """A residual block of two convolutions (He et al. 2016)."""
    h = net.normalised(x, f"{name}.gain")
    h = net.rectified(net.convolution(h, f"{name}.first", dilation=dilation))
    return x + net.convolution(h, f"{name}.second")
