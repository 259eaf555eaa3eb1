"""The floor network in NumPy, so that labelling needs no deep-learning library."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import ModelFileError
from pgm_places.floor.architecture import forward, parameters

Array = NDArray[np.float32]

_LARGEST = 63


@dataclass(frozen=True, eq=False)
class FloorNetwork:
    """A trained network."""

    # the parameters of :func:`~pgm_places.floor.architecture.parameters`
    weights: Mapping[str, Array] = field(repr=False)

    def __post_init__(self) -> None:
        for name, shape in parameters():
            if name not in self.weights or self.weights[name].shape != shape:
                came = self.weights[name].shape if name in self.weights else "nothing"
                raise ModelFileError(f"floor network: {name} must have shape {shape}, got {came}")

    def scores(self, inputs: Array) -> Array:
        """(h, w, 4) scores of the labels; a softmax makes probabilities of them.

        ``inputs`` (h, w, 10): from :func:`~pgm_places.floor.raster.network_inputs`; h and w
        multiples of 16.
        """
        logits: Array = forward(inputs, self)
        return logits

    def convolution(
        self,
        x: Array,
        name: str,
        *,
        stride: int = 1,
        dilation: int = 1,
        _values_at_once: int = 400_000,
    ) -> Array:
        """The convolution of that name, as one matrix product for each band of rows.

        ``_values_at_once`` limits the numbers of its operand, so that it stays in the cache.
        """
        kernel, bias = self.weights[f"{name}.weights"], self.weights[f"{name}.bias"]
        side, inputs = kernel.shape[0], kernel.shape[2]
        if side == 1:
            return x @ kernel[0, 0] + bias
        h, w = x.shape[0] // stride, x.shape[1] // stride
        padded = np.pad(x, ((dilation, dilation), (dilation, dilation), (0, 0)))
        matrix = kernel.reshape(-1, kernel.shape[3])
        summed = np.empty((h, w, kernel.shape[3]), np.float32)
        band = max(1, _values_at_once // (w * len(matrix)))
        around = np.empty((band, w, side * side, inputs), np.float32)
        for first in range(0, h, band):
            n = min(band, h - first)
            for k in range(side * side):
                top, left = k // side * dilation + first * stride, k % side * dilation
                rows = slice(top, top + (n - 1) * stride + 1, stride)
                columns = slice(left, left + (w - 1) * stride + 1, stride)
                around[:n, :, k] = padded[rows, columns]
            product = around[:n].reshape(n * w, -1) @ matrix
            summed[first : first + n] = product.reshape(n, w, -1)
        summed += bias
        return summed

    def rectified(self, x: Array) -> Array:
        """The positive part, in place."""
        return np.maximum(x, 0, out=x)

    def normalised(self, x: Array, name: str) -> Array:
        """Every cell's channels over their root mean square, times a gain for each channel."""
        power = np.einsum("hwc,hwc->hw", x, x) / np.float32(x.shape[2])
        scaled: Array = x * (1 / np.sqrt(power + np.float32(1e-3)))[..., None]
        scaled *= self.weights[name]
        return scaled

    def enlarged(self, x: Array) -> Array:
        """Every cell as two by two."""
        return x.repeat(2, axis=0).repeat(2, axis=1)

    def packed(self) -> NDArray[np.uint8]:
        """A fifth of the bytes: weights quantised to integers up to 63, with a unit per output."""
        numbers, others = [], []
        for name, _ in parameters():
            values = self.weights[name]
            if _is_kernel(name):
                unit = np.abs(values).max(axis=(0, 1, 2)) / _LARGEST
                unit = np.maximum(unit, np.finfo(np.float32).tiny).astype(np.float32)
                numbers.append(np.rint(values / unit).astype(np.int8).ravel())
                others.append(unit)
            else:
                others.append(values)
        head = np.concatenate(others).astype("<f4").tobytes()
        # Weights contain no repetitions: without a search for them, the result is 1 % smaller.
        writer = zlib.compressobj(9, memLevel=9, strategy=zlib.Z_HUFFMAN_ONLY)
        packed = writer.compress(np.concatenate(numbers).tobytes()) + writer.flush()
        return np.frombuffer(head + packed, np.uint8)

    @classmethod
    def unpacked(cls, data: NDArray[np.generic]) -> "FloorNetwork":
        """The network from the bytes of :meth:`packed`.

        ModelFileError: the bytes do not hold a network of this shape.
        """
        raw = np.ascontiguousarray(data).tobytes()
        n_others = sum(_n_others(name, shape) for name, shape in parameters())
        n_numbers = sum(math.prod(shape) for name, shape in parameters() if _is_kernel(name))
        reader = zlib.decompressobj()
        try:
            numbers = reader.decompress(raw[4 * n_others :], n_numbers + 1)
        except zlib.error as error:
            raise ModelFileError(
                f"floor network: its weights cannot be unpacked ({error})"
            ) from None
        if len(numbers) != n_numbers:
            raise ModelFileError(
                f"floor network: {n_numbers} weights wanted, got {len(numbers)}; it is damaged, or "
                "of another version"
            )
        weights, kernels = {}, np.frombuffer(numbers, np.int8).astype(np.float32)
        others = np.frombuffer(raw[: 4 * n_others], "<f4").astype(np.float32)
        for name, shape in parameters():
            mine, others = np.split(others, [_n_others(name, shape)])
            if _is_kernel(name):
                kernel, kernels = np.split(kernels, [math.prod(shape)])
                weights[name] = kernel.reshape(shape) * mine
            else:
                weights[name] = mine
        return cls(weights)


def _is_kernel(name: str) -> bool:
    return name.endswith(".weights")


def _n_others(name: str, shape: tuple[int, ...]) -> int:
    """Number of full-precision values of a parameter: the units of a kernel, or all."""
    return shape[-1] if _is_kernel(name) else math.prod(shape)
