"""Frames a second on a map of 100 million cells: ``python -m tests.studio.frames [SIDE]``."""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from pgm_places.io.maps.map_server import save_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from tests.studio.browser import launched, studio
from tests.studio.test_page import SIZE, until

PAN_S = 4
SCROLL = """async ({ seconds, scale }) => {
    const { view, stage } = studio;
    view.zoom(scale / view.scale);
    await new Promise((done) => setTimeout(done, 1500));
    const start = performance.now();
    const times = [];
    let last = start;
    await new Promise((done) => {
        const step = (now) => {
            times.push(now - last);
            last = now;
            const turn = (now - start) / 700;
            view.move(14 * Math.cos(turn), 9 * Math.sin(turn));
            if (now - start < 1000 * seconds) requestAnimationFrame(step);
            else done();
        };
        requestAnimationFrame(step);
    });
    const sorted = times.slice(1).sort((a, b) => a - b);
    return { frames: sorted.length / seconds, slow: sorted[Math.floor(0.95 * sorted.length)] };
}"""


def main(side: int) -> None:
    """Tell how fluently a large map moves at several scales."""
    floor = generate_building(3).grid.cells
    times = [-(-side // length) for length in floor.shape]
    cells = np.tile(floor, times)[:side, :side]
    with tempfile.TemporaryDirectory() as name, launched() as browser:
        save_map(OccupancyGrid(cells, 0.05), Path(name) / "campus")
        options = ("--model", "none", "--out", Path(name) / "kept")
        with studio(Path(name) / "campus.yaml", *options) as process:
            page = browser.new_page(viewport=SIZE)
            page.goto(process.address)
            until(page, "window.studio?.stage.tiles.get('map')?.settled")
            print(f"{side} x {side} cells")  # noqa: T201
            for scale in (0.08, 0.3, 1.0, 4.0):
                found = page.evaluate(SCROLL, {"seconds": PAN_S, "scale": scale})
                print(  # noqa: T201
                    f"{scale:g} pixels a cell: {found['frames']:.0f} frames a second, "
                    f"95 of 100 within {found['slow']:.0f} ms"
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("side", nargs="?", type=int, default=10_000, help="cells along one side")
    main(parser.parse_args().side)
