"""How far the time that ``doctor`` expects a map to take is from the time that it takes.

    python -m benchmarks.forecast ../shared/data/robots ../shared/data/floors --every 4

Labels maps one after the other on one thread and prints, for each, its cells, its processor seconds
and the forecast's share of them; then the constants of ``pgm_places.batch.forecast`` that these
maps would give.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from pgm_places.batch.forecast import Forecast, Speed
from pgm_places.batch.found_maps import FoundMap, find_maps
from pgm_places.batch.map_task import MapTask, label_one
from pgm_places.io.maps.map_server import load_map
from pgm_places.labelers.labelled_places import at_model_resolution
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions

OPTIONS = LabelOptions()


def taken(item: FoundMap, model: LoadedModel) -> tuple[Forecast, float]:
    """The work on a map, and the processor seconds it took."""
    grid = load_map(item.path).grid
    used, _ = at_model_resolution(model.labeler, grid)
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        label_one(MapTask(item.name, item.path, Path(folder) / "out", OPTIONS, model.sha256))
        seconds = time.process_time() - start
    return Forecast(grid.cells.size, int(used.free.sum())), seconds


def main() -> None:
    """Print the table and the constants."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+")
    parser.add_argument("--every", type=int, default=1, help="label one map of so many")
    options = parser.parse_args()
    model = LoadedModel.load(OPTIONS)
    speed = Speed.measured(OPTIONS)
    rows, shares = [], []
    for item in find_maps(options.folders).maps[:: options.every]:
        forecast, seconds = taken(item, model)
        rows.append([1, forecast.n_cells, forecast.n_free, seconds])
        shares.append(speed.seconds(forecast) / seconds)
        print(
            f"{item.name:36} {forecast.n_cells:9,} cells, {forecast.n_free:9,} to label: "
            f"{seconds:6.2f} s, forecast {shares[-1]:.2f} of it",
            flush=True,
        )
    found = np.array(rows, np.float64)
    parts, _ = nnls(found[:, :3] / found[:, 3:], np.ones(len(found)))
    low, middle, high = np.quantile(shares, [0.05, 0.5, 0.95])
    total = sum(np.array(shares) * found[:, 3]) / found[:, 3].sum()
    print(
        f"{len(found)} maps, {1e6 * speed.seconds_per_cell:.1f} us a cell; forecast of all "
        f"{total:.2f} of what they took, of one {low:.2f} to {high:.2f} (5 to 95 %), median "
        f"{middle:.2f}\nthese maps: {parts[2] * 1e6:.1f} us a free cell, _OF_A_MAP "
        f"{parts[0] / parts[2]:,.0f}, _OF_A_CELL {parts[1] / parts[2]:.3f}"
    )


if __name__ == "__main__":
    main()
