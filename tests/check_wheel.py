"""Checks a built wheel outside the checkout: its contents, and that it works once installed."""

import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ALLOWED_TOP_LEVEL = {"pgm_places"}
TRIAL = """
import pathlib, sys
import pgm_places, pgm_places.models.mrf, pgm_places.solvers
assert pgm_places.LabelGraph and pgm_places.load
here = pathlib.Path(pgm_places.__file__)
assert "site-packages" in here.parts, here
links = [path.name for path in here.parent.iterdir() if path.is_symlink()]
assert not links, links
import pgm_places.live.live_map, pgm_places.studio.session
from pgm_places.simulation import generate_building
from pgm_places.trained import NAMES, trained_labeler, trained_tracker
assert generate_building(size="small").grid.free.any()
from pgm_places.pictures.page import render
assert "</html>" in render("base.html", title="a page", links=[])
for name in NAMES:
    assert trained_labeler(name).label_names_ == ("corridor", "room", "doorway")
assert trained_tracker().label_names_ == ("corridor", "room", "doorway")
print("wheel works:", here.parent)
"""


def check_contents(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    top = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    if top != ALLOWED_TOP_LEVEL:
        sys.exit(f"{wheel.name} installs {sorted(top)}, wanted {sorted(ALLOWED_TOP_LEVEL)}")
    if not any(name.startswith("pgm_places/_core.") for name in names):
        sys.exit(f"{wheel.name} lacks its compiled kernels")
    root = Path(__file__).resolve().parent.parent
    pages = [root / "pgm_places" / name for name in ("pictures/templates", "studio/static")]
    files = [root / "pgm_places" / name for name in ("py.typed", "__init__.pyi")]
    files += [path for folder in pages for path in folder.iterdir()]
    for link in (path for path in (root / "pgm_places").iterdir() if path.is_symlink()):
        files += link.glob("*.py")
    for wanted in (path.relative_to(root).as_posix() for path in files):
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


if __name__ == "__main__":
    built = Path(sys.argv[1])
    check_contents(built)
    try_installed(built)
