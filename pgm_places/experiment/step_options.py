"""Options of the steps of drives: updates, loops, and how scans are completed."""

from dataclasses import dataclass, field
from typing import Literal

from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.options import AtLeastZero, Options, Positive, Seed, Whole
from pgm_places.sensing.simulated_moves import N_RUNS
from pgm_places.unary.scan_model import BeamOptions


@dataclass(frozen=True, kw_only=True)
class StepOptions(Options):
    """How the steps of drives are observed and joined.

    Parameters
    ----------
    every_m : float or "auto"
        Distance between two updates in metres; ``"auto"`` is chosen for hidden Markov models on
        held-out parts of the training drives, and 0.1 for other methods.
    loop_m : float
        Link visits to the same spot within this many metres; 0 for a chain. Methods for chains see
        only the chain.
    max_range_m : float
        Reach of the completed scans.
    n_runs, seed : int
        Simulated runs in maps, from which the hidden Markov model learns its transitions.
    beams : BeamOptions
        How to complete scans of less than a full circle.
    """

    every_m: AtLeastZero | Literal["auto"] = "auto"
    loop_m: AtLeastZero = 0.0
    max_range_m: Positive = REACH_M
    n_runs: Whole = N_RUNS
    seed: Seed = 0
    beams: BeamOptions = field(default_factory=BeamOptions)
