"""How pip builds the package: scikit-build-core, with a C++ compiler from PyPI where there is none.

An editable installation compiles the extension module into the checkout, where ``make core`` renews
it; a wheel holds it as usual.
"""

import base64
import hashlib
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import core  # in the same folder
from scikit_build_core import build as scikit
from scikit_build_core.build import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

Settings = dict[str, Any] | None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """What scikit-build-core asks for, and a compiler."""
    return scikit.get_requires_for_build_wheel(config_settings) + core.compiler_requirements()


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """The same."""
    return scikit.get_requires_for_build_editable(config_settings) + core.compiler_requirements()


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Compile the extension module into a wheel."""
    core.check_links()
    core.announce()
    with core.compiler():
        return scikit.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(
    wheel_directory: str,
    config_settings: Settings = None,
    metadata_directory: str | None = None,  # noqa: ARG001  part of the interface
) -> str:
    """Compile the extension module in place; the wheel only says where the checkout is."""
    core.check_links()
    if not core.is_current():
        core.compile_in_place(sys.executable)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        about = folder / prepare_metadata_for_build_editable(name, config_settings)
        # A plain path, so that PYTHONPATH goes first as ever.
        (folder / "pgm_places.pth").write_text(f"{core.ROOT}\n", encoding="utf-8")
        return packed(folder, about, Path(wheel_directory))


def packed(folder: Path, about: Path, target: Path) -> str:
    """The name of the wheel made of a folder and the ``.dist-info`` in it."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    record = about / "RECORD"
    with record.open("w", encoding="utf-8") as lines:
        for path in files:
            digest = base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest())
            name = path.relative_to(folder).as_posix()
            lines.write(f"{name},sha256={digest.rstrip(b'=').decode()},{path.stat().st_size}\n")
        lines.write(f"{record.relative_to(folder).as_posix()},,\n")
    tags = [
        line.removeprefix("Tag: ")
        for line in (about / "WHEEL").read_text(encoding="utf-8").splitlines()
        if line.startswith("Tag: ")
    ]
    wheel = target / f"{about.name.removesuffix('.dist-info')}-{tags[0]}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in [*files, record]:
            archive.write(path, path.relative_to(folder))
    return wheel.name
