"""The page of many maps, as a browser shows it; needs Chromium."""

import subprocess
import sys
import tempfile
from pathlib import Path

from experiments.pictures.kept import keep
from pgm_places import save_map
from pgm_places.datasets import generate_building
from tests.studio.browser import launched

N_MAPS = 6
WINDOW = {"width": 1300, "height": 890}


def many_maps() -> None:
    """Six small floors and a damaged file, labelled by the command."""
    with tempfile.TemporaryDirectory() as name, launched() as browser:
        folder = Path(name)
        for seed in range(1, N_MAPS + 1):
            grid = generate_building(seed, size="small", resolution_m=0.05).grid
            save_map(grid, folder / "floors" / f"floor{seed:03}")
        damaged = folder / "floors" / "floor007.yaml"
        damaged.write_text("image: floor007.png\nresolution: none\n", encoding="utf-8")
        words = [sys.executable, "-m", "pgm_places", "label", folder / "floors"]
        words += ["--out", folder / "labelled", "--jobs", "1", "--quiet"]
        subprocess.run(words, check=False)  # 3: one of them could not be labelled
        page = browser.new_page(viewport=WINDOW)
        page.goto((folder / "labelled" / "index.html").as_uri())
        keep("many_maps", page.screenshot())
