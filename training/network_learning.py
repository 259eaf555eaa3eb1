"""Training of the floor network with TensorFlow, which labelling does not need."""

import os
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from queue import Queue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.floor.architecture import N_INPUTS, forward, parameters
from pgm_places.training.crops import N_TARGETS, SIDE

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
import tensorflow as tf

Batch = tuple[NDArray[np.float32], NDArray[np.float32]]

BATCH = 8
_WARM_UP = 60
"""Steps over which the learning rate rises from zero."""

_DECAY = 1e-3
_HALLS = 0.3
"""Weight of the loss of hall against corridor, relative to circulation against rooms."""

_SLOTS = ("weights", "averaged", "first", "second")


def fresh(seed: int) -> dict[str, NDArray[np.float32]]:
    """Random parameters (He et al. 2015); residual blocks begin small."""
    rng = np.random.default_rng(seed)
    weights = {}
    for name, shape in parameters():
        if name.endswith(".weights"):
            spread = np.sqrt(2 / np.prod(shape[:-1]))
            spread *= 0.2 if ".second" in name else 0.1 if name.startswith("scores") else 1.0
            weights[name] = (rng.normal(size=shape) * spread).astype(np.float32)
        else:
            weights[name] = np.full(shape, float(name.endswith(".gain")), np.float32)
    return weights


class _TensorFlow:
    """The operations of the network on tensors of half precision."""

    def __init__(self, weights: Mapping[str, Any]) -> None:
        self.weights = {name: tf.cast(value, tf.bfloat16) for name, value in weights.items()}

    def convolution(self, x: Any, name: str, *, stride: int = 1, dilation: int = 1) -> Any:
        if stride == 2:
            x = tf.pad(x, [[0, 0], [1, 1], [1, 1], [0, 0]])
        padding = "SAME" if stride == 1 else "VALID"
        kernel = self.weights[f"{name}.weights"]
        y = tf.nn.conv2d(x, kernel, stride, padding, dilations=dilation)
        return tf.nn.bias_add(y, self.weights[f"{name}.bias"])

    def rectified(self, x: Any) -> Any:
        return tf.nn.relu(x)

    def normalised(self, x: Any, name: str) -> Any:
        power = tf.reduce_mean(x * x, -1, keepdims=True)
        return x * tf.math.rsqrt(power + tf.cast(1e-3, x.dtype)) * self.weights[name]

    def enlarged(self, x: Any) -> Any:
        b, h, w, c = x.shape
        return tf.reshape(
            tf.broadcast_to(x[:, :, None, :, None], (b, h, 2, w, 2, c)), (b, 2 * h, 2 * w, c)
        )


def tensorflow_scores(
    weights: Mapping[str, NDArray[np.float32]], inputs: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(h, w, 4) scores of the network in half precision, as in training."""
    x = tf.cast(inputs[np.newaxis], tf.bfloat16)
    return np.asarray(tf.cast(forward(x, _TensorFlow(weights))[0], tf.float32))


def _loss(scores: Any, shares: Any) -> tuple[Any, Any]:
    """Weighted cross entropy, and accuracy."""
    # Within a crop, a label has the weight of the square root of its inverse frequency, at most 5;
    # a crop has the weight of the square root of its labelled cells.
    log_p = tf.nn.log_softmax(tf.cast(scores, tf.float32))
    circulation = tf.reduce_logsumexp(tf.gather(log_p, [0, 3], axis=-1), axis=-1)
    coarse = tf.stack([circulation, log_p[..., 1], log_p[..., 2]], axis=-1)
    wanted = tf.stack(
        [shares[..., 0] + shares[..., 3] + shares[..., 4], shares[..., 1], shares[..., 2]], axis=-1
    )
    count = tf.reduce_sum(wanted, (1, 2))
    total = tf.reduce_sum(count, 1)
    weight = tf.minimum(tf.sqrt(total[:, None] / tf.maximum(count, 20.0)), 5.0)
    cost = tf.reduce_sum(wanted * coarse * weight[:, None, None], (1, 2, 3))
    halls = shares[..., 0] * (log_p[..., 0] - circulation)
    halls += shares[..., 3] * (log_p[..., 3] - circulation)
    cost += _HALLS * weight[:, 0] * tf.reduce_sum(halls, (1, 2))
    loss = -tf.reduce_sum(cost / tf.sqrt(total + 200)) / tf.reduce_sum(tf.sqrt(total))
    right = tf.cast(tf.argmax(coarse, -1) == tf.argmax(wanted, -1), tf.float32)
    accuracy = tf.reduce_sum(right * tf.reduce_sum(wanted, -1)) / tf.reduce_sum(total)
    return loss, accuracy


@dataclass
class Trainer:
    """A network in training.

    Parameters
    ----------
    start : mapping of str to array
        The parameters of a network, new or trained; or an earlier :meth:`state`.
    """

    start: Mapping[str, NDArray[Any]]

    def __post_init__(self) -> None:
        resumed = "steps" in self.start
        self.steps = int(self.start["steps"]) if resumed else 0
        self.slots: dict[str, dict[str, Any]] = {}
        for slot in _SLOTS:
            known = slot in ("weights", "averaged")
            self.slots[slot] = {
                name: tf.Variable(
                    self.start[f"{slot}/{name}"]
                    if resumed
                    else self.start[name]
                    if known
                    else np.zeros(shape, np.float32)
                )
                for name, shape in parameters()
            }
        self._step = tf.function(
            self._learn,
            input_signature=[
                tf.TensorSpec((BATCH, SIDE // 2, SIDE // 2, N_INPUTS)),
                tf.TensorSpec((BATCH, SIDE // 2, SIDE // 2, N_TARGETS)),
                *(tf.TensorSpec(()),) * 3,
            ],
        )

    @property
    def network(self) -> dict[str, NDArray[np.float32]]:
        """The averaged parameters."""
        return {name: value.numpy() for name, value in self.slots["averaged"].items()}

    def learn(
        self, batches: Iterator[Batch], n_steps: int, rate_at: Callable[[int], float]
    ) -> tuple[float, float]:
        """Train for some steps; mean loss and accuracy. A second thread makes the crops."""
        figures = []
        for x, y in _ahead(batches, n_steps):
            self.steps += 1
            rate = rate_at(self.steps) * min(1.0, self.steps / _WARM_UP)
            keep = min(0.998, (1 + self.steps) / (10 + self.steps))
            figures.append(self._step(x, y, *(np.float32(v) for v in (rate, keep, self.steps))))
        loss, accuracy = np.mean([[float(v) for v in pair] for pair in figures], axis=0)
        return float(loss), float(accuracy)

    def state(self) -> dict[str, NDArray[Any]]:
        """The state for continued training: parameters, their averages, moments, steps."""
        return {"steps": np.array(self.steps)} | {
            f"{slot}/{name}": value.numpy()
            for slot, values in self.slots.items()
            for name, value in values.items()
        }

    def _learn(self, x: Any, y: Any, rate: Any, keep: Any, step: Any) -> tuple[Any, Any]:
        """One step of Adam with decoupled decay (Loshchilov and Hutter 2019)."""
        weights, averaged, first, second = (self.slots[slot] for slot in _SLOTS)
        names = list(weights)
        with tf.GradientTape() as tape:
            loss, accuracy = _loss(forward(tf.cast(x, tf.bfloat16), _TensorFlow(weights)), y)
        gradients = tape.gradient(loss, [weights[name] for name in names])
        gradients, _ = tf.clip_by_global_norm(gradients, 1.0)
        for name, gradient in zip(names, gradients, strict=True):
            first[name].assign(0.9 * first[name] + 0.1 * gradient)
            second[name].assign(0.999 * second[name] + 0.001 * gradient * gradient)
            slope = first[name] / (1 - tf.pow(0.9, step))
            scale = tf.sqrt(second[name] / (1 - tf.pow(0.999, step))) + 1e-8
            weights[name].assign_sub(rate * (slope / scale + _DECAY * weights[name]))
            averaged[name].assign(keep * averaged[name] + (1 - keep) * weights[name])
        return loss, accuracy


def _ahead(batches: Iterator[Batch], n: int) -> Iterator[Batch]:
    """The next n batches, made by a second thread ahead of use."""
    queue: Queue[Any] = Queue(4)

    def fill() -> None:
        try:
            for _ in range(n):
                queue.put(next(batches))
        except BaseException as error:  # noqa: BLE001  the caller raises it
            queue.put(error)

    threading.Thread(target=fill, daemon=True).start()
    for _ in range(n):
        batch = queue.get()
        if isinstance(batch, BaseException):
            raise batch
        yield batch
