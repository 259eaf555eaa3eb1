"""How long maps will take to be labelled: an estimate from their cells and this machine's speed."""

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from pgm_places.batch.map_task import Failure, MapTask, label_one
from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelers.labelled_places import at_model_resolution
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.simulation.building import generate_building

# What takes time, each as so many free cells of the model: to begin with a map, to read and paint a
# cell of its own, and to label a free one. Fitted to the processor time of maps on one thread.
_OF_A_MAP, _OF_A_CELL = 15_000, 0.05


@dataclass(frozen=True)
class Forecast:
    """The work on a map.

    Parameters
    ----------
    n_cells : int
        Of the map as it came.
    n_free : int
        Free cells at the model's resolution: those to be labelled.
    """

    n_cells: int
    n_free: int

    @property
    def work(self) -> float:
        """In units of the time that a free cell takes.

        Examples
        --------
        >>> Forecast(n_cells=1_000_000, n_free=200_000).work
        265000.0
        """
        return _OF_A_MAP + _OF_A_CELL * self.n_cells + self.n_free


@dataclass(frozen=True)
class Speed:
    """How fast this machine labels maps with a model, on one thread.

    Parameters
    ----------
    seconds_per_cell : float
        Processor time per unit of :attr:`Forecast.work`.
    """

    seconds_per_cell: float

    @classmethod
    def measured(cls, options: LabelOptions) -> Self:
        """From labelling a small generated floor: after a first time, which loads all kernels.

        Raises
        ------
        InputError
            The model cannot label the floor.
        """
        model = LoadedModel.load(options)
        grid = generate_building(1, size="small", resolution_m=0.05).grid
        used, _ = at_model_resolution(model.labeler, grid)
        with tempfile.TemporaryDirectory(prefix="pgm-places-") as temporary:
            folder = Path(temporary)
            map_yaml, out = save_map(grid, folder / "floor"), folder / "out"
            _, *seconds = [
                _processor_seconds(MapTask("floor", map_yaml, out / name, options, model.sha256))
                for name in ("first", "second", "third", "fourth")
            ]
        # Other load on the machine makes a run slower, never faster.
        return cls(min(seconds) / Forecast(grid.cells.size, int(used.free.sum())).work)

    def seconds(self, forecast: Forecast) -> float:
        """Processor time that a map is expected to take."""
        return self.seconds_per_cell * forecast.work


def _processor_seconds(task: MapTask) -> float:
    """The processor time of a task; on a busy machine, the time that goes by says little."""
    start = time.process_time()
    outcome = label_one(task)
    if isinstance(outcome, Failure):
        raise InputError(f"the speed of this machine could not be measured: {outcome.message}")
    return time.process_time() - start
