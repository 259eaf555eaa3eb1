"""A wheel that brings the machine code of its kernels, made of one without.

    python tools/compiled_wheel.py dist/NAME-py3-none-any.whl

It is for Linux on x86-64 and for the Python and the numba that make it. The code is compiled from
the wheel's own sources.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from packaging.tags import sys_tags

from pgm_places.kernels.shipped_code import FEATURES, LEVEL

PLATFORM = "manylinux_2_17_x86_64"
"""The code links against nothing but Python, numba and functions as old as C."""
HERE = Path(__file__).resolve().parent


def compiled_wheel(pure: Path) -> Path:
    """The wheel for this Python, beside the one that it is made of."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel("unpack", pure, "--dest", folder)
        [root] = folder.iterdir()
        compile_kernels(root)
        wheel("pack", root, "--dest", folder)
        [packed] = folder.glob("*.whl")
        tag = next(sys_tags())
        names = {"python": tag.interpreter, "abi": tag.abi, "platform": PLATFORM}
        wheel("tags", "--remove", *(f"--{kind}-tag={name}" for kind, name in names.items()), packed)
        [built] = folder.glob("*.whl")
        return Path(shutil.copy(built, pure.parent))


def compile_kernels(root: Path) -> None:
    """Put machine code beside the sources of an unpacked wheel."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-P", HERE / "compile_kernels.py"],
            check=True,
            cwd=folder,
            stdout=subprocess.DEVNULL,
            env={
                **{name: value for name, value in os.environ.items() if "NUMBA_" not in name},
                "PYTHONPATH": str(root),
                "PYTHONDONTWRITEBYTECODE": "1",  # the folder becomes the wheel
                "PGM_PLACES_CACHE_DIR": str(Path(folder, "cache")),
                "PGM_PLACES_NUM_THREADS": "1",  # or a second process would compile the same
                "NUMBA_CPU_NAME": LEVEL,
                "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in FEATURES),
                "NUMBA_DISABLE_INTEL_SVML": "1",  # it is not everywhere
            },
        )


def wheel(*arguments: object) -> None:
    """Run a command of the package of that name."""
    command = [sys.executable, "-m", "wheel", *map(str, arguments)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    compiled_wheel(Path(sys.argv[1]))
