"""Checks a built wheel outside the checkout: its contents, and that it works once installed."""

import os
import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ALLOWED_TOP_LEVEL = {"pgm_places"}
TRIAL = """
import pathlib, sys
import pgm_places, pgm_places.models.independent, pgm_places.solvers
assert pgm_places.LabelGraph and pgm_places.load
here = pathlib.Path(pgm_places.__file__)
assert "site-packages" in here.parts, here
assert not (here.parent / "models").is_symlink()
from pgm_places.datasets import generate_building
from pgm_places.trained import NAMES, trained_labeler, trained_tracker
assert generate_building(size="small").grid.free.any()
from pgm_places.reproduce.html_page import html_page
assert "</html>" in html_page([], here.parent)
for name in NAMES:
    assert trained_labeler(name).label_names_ == ("corridor", "room", "doorway")
assert trained_tracker().label_names_ == ("corridor", "room", "doorway")
print("wheel works:", here.parent)
"""


LABEL = """
import sys
from pathlib import Path
from pgm_places.cli.app import run
from pgm_places.datasets import generate_building
from pgm_places.io.maps.map_server import save_map
save_map(generate_building(1).grid, Path("map"))
run(["label", "map.yaml", "--out", sys.argv[1], "--quiet"])
print(*["numba"] * ("numba" in sys.modules))
"""


def check_contents(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    top = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    if top != ALLOWED_TOP_LEVEL:
        sys.exit(f"{wheel.name} installs {sorted(top)}, wanted {sorted(ALLOWED_TOP_LEVEL)}")
    for wanted in ("pgm_places/models/boosting.py", "pgm_places/solvers/max_flow.py"):
        if wanted not in names:
            sys.exit(f"{wheel.name} lacks {wanted}")
    root = Path(__file__).resolve().parent.parent
    pages = [root / "pgm_places" / name for name in ("report/templates", "studio/static")]
    files = ["pgm_places/py.typed", "pgm_places/__init__.pyi"]
    files += [path.relative_to(root).as_posix() for folder in pages for path in folder.iterdir()]
    for wanted in files:
        if wanted not in names:
            sys.exit(f"{wheel.name} lacks {wanted}")


def try_installed(wheel: Path) -> None:
    """Install the wheel in a fresh environment that sees this one's dependencies, and use it."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        venv.create(home / "env", with_pip=True)
        python = home / "env" / "bin" / "python"
        if not python.exists():
            python = home / "env" / "Scripts" / "python.exe"
        run = [str(python), "-m", "pip", "install", "--quiet", "--no-deps", str(wheel.resolve())]
        subprocess.run(run, check=True, cwd=home)
        dependencies = next(path for path in sys.path if path.endswith("site-packages"))
        start = f"import sys; sys.path.append({dependencies!r})\n"
        subprocess.run([str(python), "-c", start + TRIAL], check=True, cwd=home)
        if not wheel.stem.endswith("-any"):
            try_compiled([str(python), "-c", start + LABEL], home)


def try_compiled(label: list[str], home: Path) -> None:
    """A first run compiles nothing, and gives what it gives where numba compiles all."""
    brought = said(label, home, "brought")
    if "numba" in brought or list((home / "brought-cache").rglob("*")):
        sys.exit("a first run has compiled kernels that the wheel should have brought")
    if "numba" not in said(label, home, "compiled", NUMBA_OPT="3"):  # as it is; but it has to ask
        sys.exit("the kernels that the wheel brought were used where they may not be")
    for path in (home / "brought").iterdir():
        if path.read_bytes() != (home / "compiled" / path.name).read_bytes():
            sys.exit(f"{path.name} differs between the kernels of the wheel and numba's")
    sys.stdout.write("a first run compiles nothing, and its results are the same\n")


def said(label: list[str], home: Path, out: str, **variables: str) -> str:
    """What labelling with an empty cache prints last."""
    environment = {**os.environ, "PGM_PLACES_CACHE_DIR": str(home / f"{out}-cache"), **variables}
    done = subprocess.run(
        [*label, out], check=True, cwd=home, env=environment, capture_output=True, text=True
    )
    return done.stdout.splitlines()[-1]


if __name__ == "__main__":
    built = Path(sys.argv[1])
    check_contents(built)
    try_installed(built)
