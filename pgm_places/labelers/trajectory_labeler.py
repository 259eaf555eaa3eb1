"""TrajectoryLabeler: labels the places along a trajectory, offline or online."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public_options
from pgm_places.errors import NotFittedError
from pgm_places.features.custom import as_features
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers import method as method_use
from pgm_places.labelers.labeler import Labeler
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.tracking import OnlineLabeler, filter_of
from pgm_places.labelers.trajectory_learning import (
    EVERY_M,
    ChosenDistance,
    KnownMaps,
    WithDistance,
    learn_labelers,
    segment_problem,
)
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.options import AtLeastZero, Seed, Whole
from pgm_places.progress import Progress, report_stage, reporting_to
from pgm_places.sensing.sensor import Sensor
from pgm_places.sensing.simulated_moves import N_RUNS
from pgm_places.trajectories.path import PathSegments
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.floor_model import FloorModel, columns_of
from pgm_places.unary.local_features import with_local_floor
from pgm_places.unary.options import NumberOfFolds
from pgm_places.unary.scan_model import BeamOptions, ScanModel, check_scan_features, observed_along

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does not need it
    from pgm_places.models.decision_list import DecisionListClassifier

# Farther walls differ too much between scans and maps (glass, clutter, distance of beams).
REACH_M = 12.0

METHOD = HiddenMarkovModel()
SENSOR = Sensor(max_range_m=REACH_M)
BEAMS = BeamOptions()


@public_options
@dataclass(eq=False, repr=False)
class TrajectoryLabeler(WithDistance, Labeler):
    """Learns places from labelled maps and trajectories, and labels trajectories.

    Each scan is completed to the full circle and scored by the boosted list. The method, a hidden
    Markov model by default, labels the sequence of observations. The steps within ``every_m`` are
    one observation, the mean of their probabilities.

    Parameters
    ----------
    label_names : sequence of K str
        The places to distinguish.
    method : Backend or str
        A method of :mod:`pgm_places.inference.backends` for the chain of observations, or its name.
    every_m : float or "auto"
        Distance between updates (m); 0 for every scan. ``"auto"`` chooses it on held-out parts of
        trajectories for hidden Markov models (``update_m``), and is 0.1 for other methods.
    loop_m : float
        Segments of different passes within this distance (m) are linked, so that a place gets the
        same label when the robot returns; 0 for a chain. Methods for chains, such as the hidden
        Markov model, ignore the links.
    beams : BeamOptions
        How scans are completed.
    sensor : Sensor
        Beams and range of the completed scans; by default 360 beams of 12 m.
    classifier : DecisionListClassifier, optional
        The unfitted list.
    n_folds : int
        Number of folds of held-out scores: buildings if there are several, else contiguous parts of
        the building and of each trajectory.
    n_runs, seed : int
        Simulated runs in maps (paper, section 5).
    features : sequence of features or names
        Custom feature columns computed from scans: see :mod:`pgm_places.features.custom`.
    extra_names : sequence of D str
        Names of additional feature columns, the argument ``extra`` of :meth:`fit` and
        :meth:`label`.
    floor : FloorModel, optional
        Floor networks for the map around the robot, with their weight relative to the list. They
        are used for labelling, not for training. :func:`pgm_places.trained.trained_floor` returns
        the shipped ones.

    Attributes
    ----------
    label_names_ : tuple of K str
        The learned labels.
    scan_model_ : ScanModel
        The list, which scores each step before inference.
    method_ : Backend
        The fitted method.
    learn_seconds_ : float
        Training time of the method (s); absent from a stored model.

    Examples
    --------
    A model trained on maps can label trajectories, too:

    >>> from pgm_places.simulation import generate_building
    >>> building = generate_building(size="small")
    >>> known = LabelledMap(building.grid, building.labels)
    >>> places = PlaceLabeler(building.label_names).fit([known])
    >>> labeler = TrajectoryLabeler.from_places(places)
    >>> centre = building.grid.cell_centres_m(np.argwhere(building.grid.free))[:1]
    >>> path = Trajectory([0.0], np.column_stack([centre, [0.0]]))
    >>> labeler.label(path, known_map=building.grid).beliefs.shape
    (1, 3)
    """

    label_names: Sequence[str]
    method: Any = METHOD
    every_m: AtLeastZero | Literal["auto"] = "auto"
    beams: BeamOptions = BEAMS
    sensor: Sensor = SENSOR
    classifier: DecisionListClassifier | None = None
    n_folds: NumberOfFolds = 5
    n_runs: Whole = N_RUNS
    seed: Seed = 0
    features: Sequence[Any] = ()
    extra_names: Sequence[str] = ()
    loop_m: AtLeastZero = 0.0
    floor: FloorModel | None = None

    scan_model_: ScanModel = field(init=False)
    method_: Any = field(init=False)
    chosen_distance_: ChosenDistance | None = field(init=False)
    learn_seconds_: float = field(init=False)

    stored_as: ClassVar[str] = "trajectory-labeler"
    _call_first: ClassVar[str] = "fit(maps, trajectories), or from_places(places)"

    @classmethod
    def from_places(cls, places: PlaceLabeler, *, every_m: AtLeastZero = EVERY_M) -> Self:
        """A labeler with the list and the transitions of a fitted PlaceLabeler.

        Parameters
        ----------
        places : PlaceLabeler
            Fitted on labelled maps.
        every_m : float
            See the class; :meth:`with_options` changes other options.

        Raises
        ------
        NotFittedError
            ``places`` is not fitted, or was stored by a version without transitions.
        InputError
            It uses a feature that needs a map.
        """
        places.check_fitted()
        if places.movement_ is None:
            raise NotFittedError(
                "this model was stored without the transitions of moving robots; train it again"
            )
        unary = places.unary_model_
        model = ScanModel(unary.classifier, unary.n_labels, unary.sensor, features=unary.features)
        return cls.of_parts(places.learned_names, places.movement_, model, every_m=every_m)

    @classmethod
    def of_parts(
        cls,
        label_names: Sequence[str],
        method: Any,
        model: ScanModel,
        *,
        every_m: AtLeastZero = EVERY_M,
        beams: BeamOptions = BEAMS,
        loop_m: float = 0.0,
        floor: FloorModel | None = None,
    ) -> Self:
        """A fitted labeler with a given list and method."""
        labeler = cls(
            tuple(label_names),
            method_use.unfitted(method),
            every_m,
            beams,
            model.sensor,
            features=model.features,
            extra_names=model.extra_names,
            loop_m=loop_m,
            floor=floor,
        )
        labeler.check_options()
        return labeler.set_learned(
            scan_model_=model, method_=method, label_names_=tuple(label_names)
        )

    def check_options(self) -> None:
        """Check the options, as :meth:`fit` does first; InputError for an invalid one."""
        super().check_options()
        method_use.as_backend(self.method)
        if self.floor is not None:
            columns_of(tuple(self.label_names))
            self.beams.check_builds_map("floor networks need one")
        check_scan_features(as_features(self.features))

    def fit(
        self,
        maps: Sequence[LabelledMap] = (),
        trajectories: Sequence[Trajectory] = (),
        *,
        extra: Sequence[ArrayLike] | None = None,
        known_map: KnownMaps = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit the list on cells and steps, then the method on held-out scores.

        Returns the labeler itself.

        Parameters
        ----------
        maps : sequence of LabelledMap
            Their labelled cells are examples; transitions are from simulated runs in them.
        trajectories : sequence of Trajectory
            Their labelled steps are examples; without maps, transitions are from them. Labels are
            indices into ``label_names``, -1 where unknown.
        extra : sequence of (T, D) float, optional
            Additional feature columns of each trajectory; not supported with maps.
        known_map : OccupancyGrid or sequence of them, optional
            Map to cast missing beams in, if ``beams`` requires it: one for all trajectories, or one
            for each.

        Raises
        ------
        LabelError
            A label has no example.
        InputError
            An option is invalid, there is nothing to train on, or columns do not fit.
        """
        with thread_limit(n_threads), reporting_to(progress):
            learn_labelers(self, {"": self.method}, maps, trajectories, extra, known_map)
        return self

    def fit_methods(
        self,
        methods: Mapping[str, Any],
        maps: Sequence[LabelledMap] = (),
        trajectories: Sequence[Trajectory] = (),
        *,
        extra: Sequence[ArrayLike] | None = None,
        known_map: KnownMaps = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> dict[str, Self]:
        """Fit several methods by name on the scores of one list, as :meth:`fit`.

        Returns a labeler per method; the labeler itself gets the last of the methods.
        """
        with thread_limit(n_threads), reporting_to(progress):
            return learn_labelers(self, methods, maps, trajectories, extra, known_map)[0]

    def online(
        self,
        geometry: ScanGeometry,
        *,
        known_map: OccupancyGrid | None = None,
        map_prior: MapPrior | None = None,
    ) -> OnlineLabeler:
        """A new online labeler for a robot with this laser: ``step(scan) -> belief``.

        InputError if the method is not a hidden Markov model.
        """
        self.check_fitted()
        observer = self.beams.observer(geometry, self.scan_model_.sensor, known_map, self.floor)
        belief_filter = filter_of(self, map_prior)
        return OnlineLabeler(
            self.scan_model_, observer, belief_filter, self.label_names_, self.floor
        )

    def scores(
        self,
        trajectory: Trajectory,
        *,
        known_map: OccupancyGrid | None = None,
        extra: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> NDArray[np.float64]:
        """(T, K) log-probabilities of each step, from the list and the networks."""
        self.check_fitted()
        model, beams, floor = self.scan_model_, self.beams, self.floor
        with (
            thread_limit(n_threads),
            reporting_to(progress),
            report_stage("scans, features and scores"),
        ):
            views = observed_along(
                trajectory, model.sensor, beams, known_map=known_map, floor=floor
            )
            log_z = model.log_proba(views.circles_m, extra, spaces=views.spaces)
        if floor is None or views.floor is None:
            return log_z
        return with_local_floor(log_z, views.floor, floor)

    def label(
        self,
        trajectory: Trajectory,
        *,
        known_map: OccupancyGrid | None = None,
        map_prior: MapPrior | None = None,
        extra: ArrayLike | None = None,
        truth: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Labeling:
        """A label for each step.

        A hidden Markov model in mode ``filter`` has the same beliefs as :meth:`online`. Other modes
        and methods label segments, also with later observations.

        Parameters
        ----------
        trajectory : Trajectory
            With scans, or without them if there is a known map to cast them in.
        known_map : OccupancyGrid, optional
            A map in the frame of the poses.
        map_prior : MapPrior, optional
            A labelled map in the frame of the poses, whose labels are additional observations.
        extra : (T, D) float, optional
            Additional feature columns, if the model was trained with any.
        truth, n_threads, progress
            See :mod:`pgm_places.labelers.labeler`.
        """
        with thread_limit(n_threads), reporting_to(progress):
            scores = self.scores(trajectory, known_map=known_map, extra=extra)
            return self.infer(trajectory, scores, map_prior=map_prior, truth=truth)

    def infer(
        self,
        trajectory: Trajectory,
        scores: NDArray[np.float64],
        *,
        map_prior: MapPrior | None = None,
        truth: ArrayLike | None = None,
    ) -> Labeling:
        """The method's labelling of given scores (T, K)."""
        self.check_fitted()
        if isinstance(self.method_, HiddenMarkovModel) and self.method_.mode == "filter":
            return filter_of(self, map_prior).run(trajectory.poses, scores)
        segments = PathSegments(trajectory.poses, self.update_m)
        if truth is not None:
            truth = segments.majority(truth, len(self.label_names_))
        problem = self.problem(segments, scores)
        if map_prior is None:
            labeling = method_use.infer(self.method_, problem, truth)
        else:
            map_prior.check_labels(self.label_names_)
            means = segments.means(map_prior.at(trajectory.poses[:, :2]))
            further = map_prior.log_likelihood(means)
            labeling = method_use.infer_further(self.method_, problem, further, truth)
        beliefs = None if labeling.beliefs is None else labeling.beliefs[segments.of_step]
        return replace(labeling, labels=labeling.labels[segments.of_step], beliefs=beliefs)

    def problem(self, segments: PathSegments, scores: NDArray[np.float64]) -> LabelingProblem:
        """The graph of a trajectory's segments with the mean scores of their steps."""
        self.check_fitted()
        return segment_problem(self, self.method_, segments, scores)

    def updated_every(self, every_m: AtLeastZero) -> tuple[Self, float]:
        """A fitted copy with another distance between updates and rescaled transitions.

        The second result is the largest error of a transition probability, 0 for other methods: see
        :meth:`.HiddenMarkovModel.rescaled`. InputError if they cannot be rescaled to this distance.
        """
        self.check_fitted()
        other, changed = self.with_options(every_m=every_m), 0.0
        if isinstance(self.method_, HiddenMarkovModel) and every_m != self.update_m:
            other.method_, changed = self.method_.rescaled(self.update_m, every_m)
        return other, changed
