"""Tests with kernels that check every access to memory and all arithmetic: with GCC, on Linux.

    python -m tests.sanitized [ARGUMENTS OF PYTEST]
    python -m tests.sanitized fuzz [ARGUMENTS OF tests.fuzz]

The kernels are compiled once more, with GCC's sanitizers for addresses and undefined behaviour; the
first error ends the run.
"""

import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "build" / "sanitized"
SOLVERS = ("layouts", "forward", "semi_markov", "local_search", "max_flow", "elimination")
SPACES = ("layouts", "segmentation", "segment_features", "gates", "unentered")
TESTS = [
    *(f"tests/solvers/test_{name}.py" for name in SOLVERS),
    *(f"tests/spaces/test_{name}.py" for name in SPACES),
    *(f"tests/simulation/test_{name}.py" for name in ("layouts", "simulated_mapping")),
    *(f"tests/topology/test_{name}.py" for name in ("clearance", "layouts", "skeleton")),
    "tests/sensing/test_local_map.py",
    "tests/models/test_layouts.py",
    "tests/studio/test_strokes.py",
]
IS_READY = "PGM_PLACES_SANITIZED"


def run_again(arguments: list[str]) -> int:
    """Compile, and run this program anew with the sanitizers' library loaded before all others."""
    if not shutil.which("g++"):
        sys.stdout.write("no g++: the kernels are not tested with sanitizers\n")
        return 0
    core = runpy.run_path(str(ROOT / "tools" / "core.py"))
    options = ("-DPGM_SANITIZE=ON", "-DCMAKE_CXX_COMPILER=g++")
    module = core["built"](sys.executable, core["tools_python"](), FOLDER, *options)
    libraries = []
    for name in ("libasan.so", "libubsan.so", "libstdc++.so"):
        asked = ["g++", f"-print-file-name={name}"]
        found = subprocess.run(asked, check=True, capture_output=True, text=True)
        libraries.append(found.stdout.strip())
    environment = {
        **os.environ,
        IS_READY: str(module),
        "LD_PRELOAD": " ".join(libraries),
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",  # as Python expects
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }
    command = [sys.executable, "-m", "tests.sanitized", *arguments]
    return subprocess.run(command, check=False, env=environment, cwd=ROOT).returncode


def load(path: str) -> None:
    """Let that file be the compiled module."""
    spec = importlib.util.spec_from_file_location("pgm_places._core", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.modules["pgm_places._core"] = module


def main() -> int:
    """Run the tests; pytest's status."""
    arguments = sys.argv[1:] or [*TESTS, "-m", "not real_data"]  # whole buildings take minutes
    path = os.environ.get(IS_READY)
    if path is None:
        return run_again(arguments)
    load(path)
    if arguments[0] == "fuzz":
        sys.argv = sys.argv[1:]
        runpy.run_module("tests.fuzz", run_name="__main__", alter_sys=True)
    import pytest

    return int(pytest.main(["-q", "-p", "no:cacheprovider", *arguments]))


if __name__ == "__main__":
    sys.exit(main())
