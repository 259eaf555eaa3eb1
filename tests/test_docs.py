"""The documentation: its Python blocks run, its lists of names and layers are those of the code."""

import re
import sys
import tomllib
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pgm_places
from pgm_places.models import list_training
from pgm_places.models.boosting_rounds import boosted

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
FIGURE = re.compile(r"^print\(.*\)  # (\d[\d.]*|\[[^]]*\]|exact [\d.]+)")
PAGES = {
    str(path.relative_to(ROOT)): blocks
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    if (blocks := BLOCK.findall(path.read_text(encoding="utf-8")))
}

SETUP = {
    "README.md": (
        "from pgm_places import save_map\n"
        "from pgm_places.simulation import generate_building\n"
        "save_map(generate_building(size='small', resolution_m=0.05).grid, 'map')"
    ),
    "docs/first_steps.md": (
        "from matplotlib import pyplot\n"
        "pyplot.switch_backend('agg')\n"
        "from pgm_places import save_map\n"
        "from pgm_places.simulation import generate_building\n"
        "save_map(generate_building(size='small', resolution_m=0.05).grid, 'map')"
    ),
    "docs/features.md": "import numpy as np\nranges = np.full((2, 360), 3.0)",
    "docs/places.md": (
        "from pgm_places.simulation import generate_building\n"
        "from pgm_places import LabelledMap, PlaceLabeler\n"
        "from pgm_places.unary.options import SpaceOptions\n"
        "building = generate_building(size='small')\n"
        "grid, labels = building.grid, building.labels\n"
        "labeler = PlaceLabeler(\n"
        "    building.label_names,\n"
        "    space=SpaceOptions(n_rounds=5),\n"
        "    max_examples_per_map=500,\n"
        "    n_folds=2,\n"
        ").fit([LabelledMap(grid, labels)])"
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
    monkeypatch.setattr("pgm_places.models.decoders._registered", {})
    monkeypatch.setattr(list_training, "boosted", boosted_briefly)
    names: dict[str, Any] = {"__name__": "page"} | ({"np": np} if page in SETUP else {})
    exec(compile(SETUP.get(page, ""), "setup", "exec"), names)
    names["print"] = partial(check_printed, page)
    for number, block in enumerate(PAGES[page], start=1):
        exec(compile(block, f"{page}, block {number}", "exec"), names)


def boosted_briefly(*arguments: Any, n_rounds: int, **options: Any) -> Any:
    """As many rounds as are needed to run a page; the figures of none depend on more."""
    return boosted(*arguments, n_rounds=min(n_rounds, 20), **options)


def check_printed(page: str, *values: object) -> None:
    """In place of ``print``: a figure in the comment beside it is what is printed."""
    frame = sys._getframe(1)
    number = int(frame.f_code.co_filename.rpartition(" ")[2])
    line = PAGES[page][number - 1].splitlines()[frame.f_lineno - 1]
    if promised := FIGURE.search(line):
        assert " ".join(map(str, values)).startswith(promised[1]), line


def listed(page: str, first: str) -> list[str]:
    """The entries of a page's lists of names that start with ``first``."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"^   {first}(pgm_places\.\S+)$", text, re.MULTILINE)


def test_the_api_page_lists_every_public_name_once() -> None:
    names = [path.rpartition(".")[2] for path in listed("api.md", "~")]
    assert sorted(names) == sorted(set(pgm_places.__all__) - {"__version__"})


def test_the_api_page_lists_modules_that_exist_once_each_and_solvers_last() -> None:
    modules = listed("api.md", "")
    assert len(set(modules)) == len(modules)
    solvers = [name for name in modules if name.startswith("pgm_places.solvers.")]
    assert solvers == modules[-len(solvers) :]
    for name in modules:
        import_module(name)


def test_the_paths_on_the_page_for_developers_exist() -> None:
    page = (ROOT / "docs/development.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w./]+/[\w./]*|\w+\.py)`", page)
    tree = re.findall(r"^  ([a-z_/]+/|\w+\.py)", page, re.MULTILINE)
    paths = [path for path in named + tree if "NAME" not in path]
    assert len(paths) > 60
    missing = [p for p in paths if not any((ROOT / top / p).exists() for top in ("", "pgm_places"))]
    assert not missing


def test_extras_are_installed_from_the_projects_folder_and_exist() -> None:
    """No package index has the project: pages install from a checkout.

    Only the hint of a missing extra names the package, where it is installed already.
    """
    folders = (
        "docs",
        "pgm_places",
        "models",
        "solvers",
        "simulation",
        "training",
        "studio",
        "live",
        "ros",
        "examples",
    )
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    for folder in folders:
        files += [
            p for p in (ROOT / folder).rglob("*") if p.suffix in (".md", ".py", ".js", ".xml")
        ]
    texts = {path.name: path.read_text(encoding="utf-8") for path in files}
    assert not [
        name
        for name, text in texts.items()
        if 'install "pgm-places' in text and name != "plugins.py"
    ]
    named = {e for text in texts.values() for e in re.findall(r'"\.\[([a-z,-]+)\]"', text)}
    with (ROOT / "pyproject.toml").open("rb") as file:
        extras = tomllib.load(file)["project"]["optional-dependencies"]
    assert {extra for item in named for extra in item.split(",")} == set(extras)
