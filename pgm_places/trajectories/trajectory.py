"""A robot's trajectory: times, poses, scans and places."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import plotting
from pgm_places._arguments import public
from pgm_places._checks import (
    finite_array,
    integer_array,
    number_array,
    pose_array,
    require_names,
    require_shape,
    require_type,
    set_frozen,
)
from pgm_places.errors import InputError, LabelError
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import at_cells
from pgm_places.plotting import Plotted, axes_or_new, data_frame
from pgm_places.trajectories.path import headings_along
from pgm_places.trajectories.scan import Scan, ScanGeometry
from pgm_places.trajectories.similarity import Similarity

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MOST_STEPS = 100_000_000
"""Of a path that is resampled."""


@public
@dataclass(frozen=True, eq=False)
class Trajectory(Plotted):
    """T steps of a robot, in the order in which they were recorded.

    Parameters
    ----------
    times_s : (T,) float
        Time of each step. Stamps that are out of order are not changed;
        :attr:`n_backward_times` counts them.
    poses : (T, 3) float
        x, y in metres and heading in radians, counter-clockwise from the x axis: of the laser
        where there are scans, else of the robot.
    ranges_m : (T, M) float32 or None
        What each beam read, from 0 to ``geometry.range_max_m``; a beam without a return reads
        exactly ``geometry.range_max_m``. :meth:`ScanGeometry.cleaned` makes such ranges from raw
        readings.
    geometry : ScanGeometry or None
        The beams; given exactly where ``ranges_m`` is.
    labels : (T,) int or None
        True place of each step as an index into ``label_names``, -1 where it is unknown.
    label_names : tuple of str or None
        Given exactly where ``labels`` is.
    odometry : (T, 3) float or None
        Poses by wheel odometry, if ``poses`` are better ones: corrected, or true.
    name : str
        Its name in messages and tables.
    building : str, optional
        The building it is in: the drives and maps of one building are never on both sides of a
        cross-validation. Without it, contiguous parts of the trajectory are held out.

    Raises
    ------
    InputError
        Shapes do not fit together, a number is not finite, a coordinate is beyond 10^7 m, a range
        is outside ``[0, range_max_m]``, or one of two fields that belong together is missing.

    Examples
    --------
    >>> path = Trajectory([0.0, 1.0, 2.0], [[0, 0, 0], [0.5, 0, 0], [0.5, 1.0, 1.57]])
    >>> path
    Trajectory('trajectory', 3 steps, 1.5 m)
    """

    times_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    ranges_m: NDArray[np.float32] | None = None
    geometry: ScanGeometry | None = None
    labels: NDArray[np.int64] | None = None
    label_names: tuple[str, ...] | None = None
    odometry: NDArray[np.float64] | None = None
    name: str = "trajectory"
    building: str | None = None

    def __post_init__(self) -> None:
        times = finite_array("times_s", self.times_s, ("T",))
        n_steps = len(times)
        set_frozen(self, times_s=times, poses=pose_array("poses", self.poses, (n_steps, 3)))
        if self.odometry is not None:
            set_frozen(self, odometry=pose_array("odometry", self.odometry, (n_steps, 3)))
        self._check_scans(n_steps)
        self._check_labels(n_steps)

    def _check_scans(self, n_steps: int) -> None:
        if (self.ranges_m is None) != (self.geometry is None):
            raise InputError("ranges_m and geometry belong together: give both, or neither")
        if self.ranges_m is None or self.geometry is None:
            return
        ranges = finite_array(
            "ranges_m", self.ranges_m, (n_steps, self.geometry.n_beams), dtype=np.float32
        )
        reach = np.float32(self.geometry.range_max_m)
        if ranges.size and (ranges.min() < 0 or ranges.max() > reach):
            raise InputError(
                f"ranges_m must lie from 0 to range_max_m = {reach:g} m, got {ranges.min():g} to "
                f"{ranges.max():g}; geometry.cleaned(readings) makes them so"
            )
        set_frozen(self, ranges_m=ranges)

    def _check_labels(self, n_steps: int) -> None:
        if (self.labels is None) != (self.label_names is None):
            raise InputError("labels and label_names belong together: give both, or neither")
        if self.labels is None or self.label_names is None:
            return
        names = tuple(self.label_names)
        labels = integer_array("labels", self.labels, (n_steps,), low=-1, high=len(names))
        set_frozen(self, labels=labels, label_names=names)

    def __len__(self) -> int:
        return len(self.times_s)

    def __repr__(self) -> str:
        parts = [f"{self.name!r}", f"{len(self)} steps", f"{self.path_length_m:.4g} m"]
        if self.geometry is not None:
            parts.append(f"{self.geometry.n_beams} beams")
        if self.label_names is not None:
            parts.append(f"labels {', '.join(self.label_names)}")
        return f"Trajectory({', '.join(parts)})"

    # ------------------------------------------------------------------ making

    @classmethod
    def from_scans(cls, scans: Iterable[Scan], *, name: str = "trajectory") -> Self:
        """The trajectory of scans with a common geometry; with odometry if every scan has it.

        Raises
        ------
        InputError
            There is no scan, or the beams of a scan differ from those of the first.
        """
        taken = list(scans)
        if not taken:
            raise InputError(f"{name}: there is no scan to make a trajectory of")
        for step, scan in enumerate(taken):
            require_type(f"scans[{step}]", scan, Scan)
        geometry = taken[0].geometry
        for step, scan in enumerate(taken):
            if scan.geometry is not geometry and not scan.geometry.same_as(geometry):
                raise InputError(
                    f"{name}: scan {step} has {scan.geometry} but the first one {geometry}; "
                    "make one trajectory of each kind"
                )
        odometry = [scan.odometry for scan in taken if scan.odometry is not None]
        return cls(
            np.array([scan.time_s for scan in taken]),
            np.stack([scan.pose for scan in taken]),
            np.stack([scan.ranges_m for scan in taken]),
            geometry,
            odometry=np.stack(odometry) if len(odometry) == len(taken) else None,
            name=name,
        )

    def with_scans(self, ranges_m: ArrayLike, geometry: ScanGeometry) -> Self:
        """The same steps with other scans (T, M)."""
        ranges = number_array("ranges_m", ranges_m, np.float32)
        return replace(self, ranges_m=ranges, geometry=geometry)

    def with_labels(self, labels: ArrayLike, label_names: Sequence[str]) -> Self:
        """The same steps with other labels (T,), -1 where the place is unknown."""
        return replace(self, labels=np.asarray(labels), label_names=tuple(label_names))

    def relabelled(self, new_names: Mapping[str, str], label_names: Sequence[str]) -> Self:
        """The same steps with renamed labels; several labels may get one name.

        ``new_names`` maps present to new names; labels that are left out become -1. ``label_names``
        are the new labels in the order of their numbers; a new name that is not among them is a
        LabelError.

        Examples
        --------
        >>> path = Trajectory([0, 1], [[0, 0, 0], [1, 0, 0]]).with_labels([0, 1], ["1PO", "CR"])
        >>> path.relabelled({"1PO": "room"}, ["corridor", "room"]).labels.tolist()
        [1, -1]
        """
        if self.labels is None or self.label_names is None:
            raise LabelError(f"{self.name} has no labels to rename")
        names = tuple(label_names)
        unknown = [name for name in new_names.values() if name not in names]
        if unknown:
            raise LabelError(f"{unknown[0]!r} is not among the labels: {', '.join(names)}")
        numbers = [
            names.index(new_names[name]) if name in new_names else -1 for name in self.label_names
        ]
        return self.with_labels(np.array([*numbers, -1])[self.labels], names)

    def labelled_by(self, labelled_map: LabelledMap, label_names: Sequence[str]) -> Self:
        """The same steps with the labels of a map at their positions, -1 outside its window.

        A label of the map without a name is a LabelError.
        """
        names = tuple(label_names)
        cells = labelled_map.grid.cells_at_m(self.poses[:, :2])
        labels = at_cells(labelled_map.labels, cells, -1)
        if labelled_map.window is not None:
            labels[~at_cells(labelled_map.window, cells, False)] = -1
        require_names(labelled_map.name, labels, names)
        return self.with_labels(labels, names)

    # ------------------------------------------------------------------ parts

    def subset(self, steps: ArrayLike | slice) -> Self:
        """The selected steps: a slice, a boolean mask (T,), or step numbers in any order."""
        if isinstance(steps, slice):
            index = np.arange(len(self))[steps]
        else:
            index = np.asarray(steps)
            if index.dtype == np.bool_:
                require_shape("a mask", index.shape, (len(self),))
                index = np.flatnonzero(index)
            elif index.size == 0:
                index = np.empty(0, np.int64)
            index = integer_array("steps", index, ("S",), low=0, high=max(len(self), 1))
        names = ("times_s", "poses", "ranges_m", "labels", "odometry")
        columns = {name: getattr(self, name) for name in names}
        chosen = {name: rows[index] for name, rows in columns.items() if rows is not None}
        return replace(self, **chosen)

    def __getitem__(self, steps: slice) -> Self:
        return self.subset(steps)

    def resampled(self, every_m: float) -> Self:
        """The path with positions at this distance, on straight lines between the recorded ones.

        The recorded positions remain, with their labels; positions between them have no label. A
        trajectory with scans cannot be resampled (InputError).
        """
        if self.ranges_m is not None:
            raise InputError(f"{self.name} has scans, which cannot be resampled")
        if not every_m > 0:
            raise InputError(f"every_m must be above 0 metres, got {every_m}")
        if len(self) < 2:
            return self
        way = np.concatenate([[0.0], np.cumsum(self.step_lengths_m)])
        if way[-1] / every_m > MOST_STEPS:
            raise InputError(
                f"{self.name} is {way[-1]:g} m long, every_m = {every_m:g} m would divide it into "
                f"more than {MOST_STEPS} steps; leave out poses that lie far away, or take longer "
                "steps"
            )
        steps = np.union1d(np.arange(0.0, way[-1], every_m), way)
        xy = np.stack([np.interp(steps, way, self.poses[:, axis]) for axis in (0, 1)], axis=1)
        labels = None
        if self.labels is not None:
            labels = np.full(len(steps), -1)
            labels[np.searchsorted(steps, way)] = self.labels
        times = np.interp(steps, way, self.times_s)
        poses = np.column_stack([xy, headings_along(xy)])
        return replace(self, times_s=times, poses=poses, labels=labels, odometry=None)

    def scan(self, step: int) -> Scan:
        """The scan of a step, with its pose and time; an InputError without scans."""
        if self.ranges_m is None or self.geometry is None:
            raise InputError(f"{self.name} has no scans; cast them in a map, or read another file")
        if not -len(self) <= step < len(self):
            raise InputError(f"step must be one of {len(self)}, got {step}")
        odometry = None if self.odometry is None else self.odometry[step]
        return Scan(
            self.times_s[step], self.poses[step], self.ranges_m[step], self.geometry, odometry
        )

    # ------------------------------------------------------------------ views

    def graph(self) -> LabelGraph:
        """The chain of its steps: the label graph of a trajectory."""
        return LabelGraph.from_trajectory(self.poses)

    def transformed(self, similarity: Similarity) -> Self:
        """The same trajectory in another frame; a scale stretches the scans, not the odometry."""
        stretched, geometry = self.ranges_m, self.geometry
        if stretched is not None and geometry is not None and similarity.scale != 1:
            factor = similarity.scale
            geometry = ScanGeometry(
                geometry.angles_rad, factor * geometry.range_max_m, factor * geometry.range_min_m
            )
            reach = np.float32(geometry.range_max_m)
            returned = stretched < np.float32(self.geometry.range_max_m)  # type: ignore[union-attr]
            stretched = np.where(returned, np.minimum(stretched * np.float32(factor), reach), reach)
        return replace(
            self, poses=similarity.of_poses(self.poses), ranges_m=stretched, geometry=geometry
        )

    def within(self, range_max_m: float) -> Self:
        """The same scans of a sensor with less range: longer ranges become ``range_max_m``.

        An InputError without scans, or if their maximum range is smaller.
        """
        if self.ranges_m is None or self.geometry is None:
            raise InputError(f"{self.name} has no scans to shorten")
        if range_max_m > self.geometry.range_max_m:
            raise InputError(
                f"{self.name}: the scans reach {self.geometry.range_max_m:g} m, they cannot be "
                f"cut at {range_max_m:g} m"
            )
        geometry = replace(self.geometry, range_max_m=range_max_m)
        return self.with_scans(np.minimum(self.ranges_m, np.float32(range_max_m)), geometry)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the path in metres of its frame, its steps in the colours of their labels.

        Over a map, ``trajectory.plot(grid.plot())``; new axes by default. Returns the axes.
        """
        ax = axes_or_new(ax)
        plotting.draw_path(ax, self.poses[:, :2], self.labels, self.label_names or ())
        return ax

    def to_dataframe(self) -> Any:
        """The steps as a pandas.DataFrame with the index ``step``.

        Columns ``time_s``, ``x_m``, ``y_m``, ``heading_rad`` and, if known, ``label``. An
        InputError if pandas is not installed.
        """
        x, y, heading = self.poses.T
        columns = {"step": np.arange(len(self)), "time_s": self.times_s}
        columns |= {"x_m": x, "y_m": y, "heading_rad": heading}
        if self.labels is not None and self.label_names is not None:
            columns["label"] = np.array([*self.label_names, None], object)[self.labels]
        return data_frame(columns, "step")

    @property
    def step_lengths_m(self) -> NDArray[np.float64]:
        """(T - 1,) distance from each step to the next one."""
        steps = np.diff(self.poses[:, :2], axis=0)
        return np.hypot(steps[:, 0], steps[:, 1])

    @property
    def path_length_m(self) -> float:
        """Length of the path from the first step to the last."""
        return float(self.step_lengths_m.sum())

    @property
    def n_backward_times(self) -> int:
        """How many steps have an earlier stamp than the step before them."""
        return int(np.count_nonzero(np.diff(self.times_s) < 0))


@public
@dataclass(frozen=True, eq=False)
class MappedDrive:
    """A drive and the labelled map that it goes through, in the frame of the drive's poses."""

    map: LabelledMap
    drive: Trajectory

    @property
    def building(self) -> str | None:
        """The building of the drive, or of its map if the drive names none."""
        return self.drive.building or self.map.building
