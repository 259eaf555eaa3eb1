"""Further training of the shipped floor networks on the maps of an experiment."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pgm_places.floor.network import FloorNetwork
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.plugins import needed
from pgm_places.progress import report_stage
from pgm_places.simulation import generate_building, simulate_map
from pgm_places.training.labelled_raster import labelled_raster
from pgm_places.unary.floor_model import FloorModel

if TYPE_CHECKING:
    from pgm_places.training.crops import LabelledFloor

_STYLES = ("office", "school", "clinic", "home", "hotel", "varied", "university", "hall")
_NAMES = ("corridor", "room", "doorway", "hall")
_RATE = 2e-4
_OWN_SHARE = 0.5
"""Share of crops of the user's maps; the others prevent forgetting of other buildings."""


def taught_floor(
    floor: FloorModel,
    maps: Sequence[LabelledMap],
    label_names: Sequence[str],
    steps: int,
) -> FloorModel:
    """The floor networks after further training, each on other crops of the same maps.

    Raises
    ------
    InputError
        TensorFlow or OpenCV is not installed; the message says how to install it.
    """
    if not steps:
        return floor
    for module in ("cv2", "tensorflow"):
        needed(module, extra="train", purpose="teaching the floor networks (floor.steps)")
    from pgm_places.training.network_learning import Trainer

    networks = []
    with report_stage("teaching the floor networks") as stage:
        own = [_floor(item, label_names, drawn=False) for item in maps]
        others = [_floor(item, _NAMES, drawn=drawn) for item, drawn in _rehearsal()]
        for number, network in enumerate(floor.networks):
            trainer = Trainer(network.weights)
            pieces = _pieces([own, others], number)
            loss, accuracy = trainer.learn(pieces, steps, lambda _step: _RATE)
            networks.append(FloorNetwork(trainer.network))
            done = (number + 1) / len(floor.networks)
            stage.update(done, f"loss {loss:.3f}, {100 * accuracy:.1f} % of cells right")
    return replace(floor, networks=tuple(networks))


def _floor(item: LabelledMap, names: Sequence[str], *, drawn: bool) -> "LabelledFloor":
    from pgm_places.training.crops import LabelledFloor

    arrays = labelled_raster(item, names)
    return LabelledFloor.of(arrays["free"], arrays["occ"], arrays["lab"], drawn=drawn)


def _rehearsal() -> Iterator[tuple[LabelledMap, bool]]:
    """Generated buildings as drawn and as simulated robot maps; and whether they are drawn."""
    for seed, style in enumerate(_STYLES, start=9000):
        made = generate_building(
            seed,
            style=style,  # type: ignore[arg-type]
            halls="hall",
            furniture=False,
            slam_noise=False,
        )
        plan = LabelledMap(made.grid, made.labels, name=style)
        yield plan, True
        yield simulate_map(plan, _NAMES, seed=seed), False


def _pieces(sources: "Sequence[Sequence[LabelledFloor]]", seed: int) -> Iterator[Any]:
    from pgm_places.training.crops import batch
    from pgm_places.training.network_learning import BATCH

    rng = np.random.default_rng(seed)
    weights = [np.full(len(source), 1 / len(source)) for source in sources]
    while True:
        yield batch(sources, [_OWN_SHARE, 1 - _OWN_SHARE], weights, BATCH, rng)
