"""A simulated camera: counts the objects on a map that no wall hides."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, frozen_copy, integer_array
from pgm_places.features.object_counts import N_IMAGES
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import (
    AtLeastZero,
    Positive,
    Probability,
    Seed,
    Whole,
    check_options,
)
from pgm_places.options.marks import Gt, Le
from pgm_places.sensing.ray_casting import cast_poses

DEPTH_M = 0.3
"""Objects stand on desks and in cupboards: what is mapped so close before them hides nothing."""

PAIRS_AT_ONCE = 200_000


@dataclass(frozen=True, eq=False)
class PlacedObjects:
    """Objects and where they stand.

    Parameters
    ----------
    positions_m : (n, 2) float
        x, y in the map frame.
    kinds : (n,) int
        Index into ``object_names``.
    object_names : tuple of D str
    """

    positions_m: NDArray[np.float64]
    kinds: NDArray[np.int64]
    object_names: tuple[str, ...]

    def __post_init__(self) -> None:
        positions = finite_array("positions_m", self.positions_m, ("n", 2))
        names = tuple(self.object_names)
        kinds = integer_array("kinds", self.kinds, (len(positions),), low=0, high=len(names))
        object.__setattr__(self, "positions_m", frozen_copy(positions))
        object.__setattr__(self, "kinds", frozen_copy(kinds))
        object.__setattr__(self, "object_names", names)

    def __len__(self) -> int:
        return len(self.kinds)


@dataclass(frozen=True)
class SimulatedDetector:
    """Counts the objects in the images of a ring of cameras, with misses and false alarms.

    Camera k of ``n_images`` looks ``2 pi k / n_images`` to the left of the heading. An object is in
    its image where it lies within ``range_m``, within half of ``image_width_rad`` to either side,
    and no wall is between; it is then found with probability ``1 - p_miss``. Wider images overlap,
    and what lies in two of them counts twice, as in the paper, which sums over images. Each image
    also has a number of false alarms of each class, Poisson distributed.

    Parameters
    ----------
    grid : OccupancyGrid
        What hides objects: everything that is not free.
    objects : PlacedObjects
    range_m : float
        How far objects can be made out.
    n_images : int
        Images per observation: 8 in the paper.
    image_width_rad : float
        Field of view of one image; the eighth part of a circle by default.
    p_miss : float
        Probability that an object in an image is not found.
    false_alarms : float
        Mean number of things of each class found in an image where there are none.
    seed : int
        Chances depend on it and on the pose alone: other poses change nothing.

    Raises
    ------
    ConfigError
        An option outside its range.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 0, 100, 0]], resolution_m=1.0)
    >>> objects = PlacedObjects([[3.5, 0.5], [5.5, 0.5]], [0, 0], ("monitor on",))
    >>> SimulatedDetector(grid, objects).count([0.5, 0.5, 0.0]).tolist()  # one is behind the wall
    [1]
    """

    grid: OccupancyGrid
    objects: PlacedObjects
    range_m: Positive = 5.0
    n_images: Whole = N_IMAGES
    image_width_rad: Annotated[float, Gt(0), Le(2 * np.pi)] = 2 * np.pi / N_IMAGES
    p_miss: Probability = 0.0
    false_alarms: AtLeastZero = 0.0
    seed: Seed = 0

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def object_names(self) -> tuple[str, ...]:
        """The D classes of objects."""
        return self.objects.object_names

    def count(self, observation: ArrayLike) -> NDArray[np.int64]:
        """(D,) counts at one pose: x, y in metres and heading in radians, in the map frame."""
        pose = finite_array("observation", observation, (3,))
        counts: NDArray[np.int64] = self.count_along(pose[None])[0]
        return counts

    def count_along(self, poses: ArrayLike) -> NDArray[np.int64]:
        """(T, D) counts at T poses (T, 3); the same as one by one."""
        places = finite_array("poses", poses, ("T", 3))
        counts = np.zeros((len(places), len(self.object_names)), np.int64)
        step, number, images = self._visible(places)
        starts = np.searchsorted(step, np.arange(len(places) + 1))
        for t, pose in enumerate(places):
            generator = self._chance(pose)
            here = slice(starts[t], starts[t + 1])
            found = generator.binomial(images[here], 1.0 - self.p_miss)
            np.add.at(counts[t], self.objects.kinds[number[here]], found)
            expected = self.n_images * self.false_alarms
            counts[t] += generator.poisson(expected, len(self.object_names))
        return counts

    def _chance(self, pose: NDArray[np.float64]) -> np.random.Generator:
        """The random draws of one pose: each pose has its own, the same on every visit."""
        words = np.frombuffer((pose + 0.0).tobytes(), np.uint32)  # -0.0 is 0.0
        return np.random.default_rng([self.seed, *words.tolist()])

    def _visible(
        self, poses: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Steps, objects seen from them, and in how many images; by step."""
        parts = [self._visible_from(poses[:0])]
        size = max(1, PAIRS_AT_ONCE // max(len(self.objects), 1))
        for first in range(0, len(poses), size):
            step, number, images = self._visible_from(poses[first : first + size])
            parts.append((step + first, number, images))
        step, number, images = (np.concatenate(part) for part in zip(*parts, strict=True))
        return step, number, images

    def _visible_from(
        self, poses: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        offset = self.objects.positions_m[None] - poses[:, None, :2]
        distance = np.hypot(offset[..., 0], offset[..., 1])
        step, number = np.nonzero(distance <= self.range_m)
        towards = np.arctan2(offset[step, number, 1], offset[step, number, 0])
        rays = np.column_stack([poses[step, :2], towards])
        free = cast_poses(self.grid, rays, [0.0], max_range_m=self.range_m)[:, 0]
        visible = free + DEPTH_M >= distance[step, number]
        step, number, towards = step[visible], number[visible], towards[visible]
        axes = 2 * np.pi * np.arange(self.n_images) / self.n_images
        off = (towards - poses[step, 2])[:, None] - axes[None]
        off = (off + np.pi) % (2 * np.pi) - np.pi
        half = self.image_width_rad / 2
        # A border between two images belongs to one of them only.
        images = ((off >= -half) & (off < half)).sum(axis=1)
        return step, number, images.astype(np.int64)
