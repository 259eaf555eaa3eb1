"""Every Python block of the README and of the documentation runs, page by page."""

import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
PAGES = {
    str(path.relative_to(ROOT)): blocks
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    if (blocks := BLOCK.findall(path.read_text(encoding="utf-8")))
}

SETUP = {
    "README.md": (
        "from pgm_places import save_map\n"
        "from pgm_places.datasets import generate_building\n"
        "save_map(generate_building(size='small', resolution_m=0.05).grid, 'map')"
    ),
    "docs/features.md": "import numpy as np\nranges = np.full((2, 360), 3.0)",
    "docs/topology.md": (
        "from pgm_places.datasets import generate_building\n"
        "building = generate_building(size='small')\n"
        "grid, labels = building.grid, building.labels"
    ),
    "docs/trajectories.md": (
        "import numpy as np\n"
        "from pgm_places import ScanGeometry, Trajectory\n"
        "from pgm_places.io.logs.trajectories import write_trajectory\n"
        "log = Trajectory(\n"
        "    [0.0, 1.0],\n"
        "    [[0, 0, 0], [1, 0, 0]],\n"
        "    ranges_m=np.full((2, 360), 3.0),\n"
        "    geometry=ScanGeometry.full_circle(360, range_max_m=30.0),\n"
        ")\n"
        "write_trajectory('robot.log.gz', log)"
    ),
}
"""What a page takes as given: the reader's own data."""


@pytest.mark.parametrize("page", PAGES)
def test_the_blocks_of_a_page_run_one_after_the_other(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page", "np": np} if page in SETUP else {"__name__": "page"}
    exec(compile(SETUP.get(page, ""), "setup", "exec"), names)
    for number, block in enumerate(PAGES[page], start=1):
        exec(compile(block, f"{page}, block {number}", "exec"), names)
