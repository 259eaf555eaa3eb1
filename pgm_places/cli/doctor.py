"""``pgm-places doctor``: checks the installation, the cache of compiled code, and a map."""

import platform
from pathlib import Path
from typing import Annotated

from pgm_places._version import __version__
from pgm_places.cli.declarations import Argument
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import say

__all__ = ["doctor"]

REQUIRED = (
    "numpy",
    "scipy",
    "scikit-learn",
    "numba",
    "cvxpy",
    "osqp",
    "networkx",
    "pydantic",
    "matplotlib",
    "pillow",
    "pyyaml",
    "safetensors",
    "rich",
)
OPTIONAL = ("clarabel", "piqp", "ortools", "rosbags", "opencv-python-headless")


def doctor(
    map_yaml: Annotated[Path | None, Argument(metavar="MAP.yaml", help="A map to check.")] = None,
) -> None:
    """Check the installation and, optionally, a map file."""
    from pgm_places.features.own import FEATURES
    from pgm_places.inference.backends import backend_names

    rows = [["package", "version"], ["pgm-places", __version__]]
    rows += [["python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"]]
    rows += [[name, _version(name)] for name in REQUIRED]
    rows += [[f"{name} (optional)", _version(name)] for name in OPTIONAL]
    say(text_table(rows))
    say(f"\nmethods: {', '.join(backend_names())}")
    say(f"custom features: {', '.join(FEATURES.names()) or 'none installed'}")
    _kernels()
    if map_yaml is not None:
        _map(map_yaml)


def _version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # slow to import, as help is not

    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _kernels() -> None:
    from pgm_places.kernels.cache import cache_folder
    from pgm_places.kernels.shipped_code import COMPILED, shipped_folder
    from pgm_places.kernels.threads import resolve_threads

    if COMPILED.is_dir():
        folder = shipped_folder()
        fit = "not for this Python, numba and processor" if folder is None else "in use"
        say(f"kernels that came compiled: {fit}")
    folder = cache_folder()
    where = folder if folder is not None else "nowhere (recompiled in every process)"
    say(f"compiled kernels are cached in: {where}")
    say(f"threads: {resolve_threads()}")


def _map(map_yaml: Path) -> None:
    from pgm_places.cli.tables import shares_line
    from pgm_places.io.maps.map_server import load_map

    loaded = load_map(map_yaml)
    grid = loaded.grid
    height, width = grid.shape
    size = f"{width * grid.resolution_m:.1f} m x {height * grid.resolution_m:.1f} m"
    say(f"\n{map_yaml}: image {loaded.image_path}")
    say(f"{width} x {height} cells of {grid.resolution_m:g} m ({size})")
    say(f"origin {grid.origin_xy_m}, yaw {grid.yaw_rad:g} rad")
    say(shares_line(loaded.fractions))
    for message in loaded.warnings:
        say(f"warning: {message}")
    if not loaded.warnings:
        say("no problems found")
