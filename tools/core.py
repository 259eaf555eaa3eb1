"""Compiles the kernels in C++ into the checkout, as pgm_places/_core.*: ``make core``.

    python tools/core.py [--if-changed]

They are compiled for the Python that runs this. CMake, Ninja and nanobind are asked from PyPI where
they are missing, and so is a C++ compiler (zig). ``--if-changed`` does nothing where the module is
newer than its sources.
"""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from stub import write_stub  # in the same folder

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / f"core-{sysconfig.get_platform()}-{sys.implementation.cache_tag}"
LINKED = ("models", "solvers", "simulation", "training", "studio", "live")
FOLDERS = ("pgm_places", *LINKED)
COMPILERS = ("c++", "g++", "clang++")


def has_compiler() -> bool:
    """Whether a C++ compiler is named by ``CXX`` or found.

    On Windows only a named one counts: what CMake finds by itself there is Microsoft's, which does
    not know vectors.
    """
    found = os.name != "nt" and any(map(shutil.which, COMPILERS))
    return bool(os.environ.get("CXX")) or found


def compiler_requirements() -> list[str]:
    """What pip has to install for there to be a compiler."""
    if has_compiler():
        return []
    return ["ziglang", "ninja"] if os.name == "nt" else ["ziglang"]


@contextmanager
def compiler(python: str = sys.executable) -> Iterator[None]:
    """Where no C++ compiler is found, have CMake take the zig installed next to ``python``."""
    if has_compiler():
        yield
        return
    # CMake wants programs without arguments, and the same ones the next time.
    programs = {name: _program(python, name) for name in ("c++", "ar", "ranlib")}
    arguments = [f"-DCMAKE_AR={programs['ar']}", f"-DCMAKE_RANLIB={programs['ranlib']}"]
    arguments.append("-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON")  # zig keeps none
    before = {name: os.environ.get(name) for name in ("CXX", "CMAKE_ARGS", "CMAKE_GENERATOR")}
    os.environ["CXX"] = programs["c++"]
    if os.name == "nt":
        os.environ["CMAKE_GENERATOR"] = "Ninja"  # Visual Studio asks for no other compiler
    os.environ["CMAKE_ARGS"] = shlex.join([*shlex.split(before["CMAKE_ARGS"] or ""), *arguments])
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _program(python: str, command: str) -> str:
    """A program that calls one of zig's commands."""
    folder = ROOT / "build" / "zig"
    folder.mkdir(parents=True, exist_ok=True)
    if os.name == "nt":
        path = folder / f"zig-{command}.cmd"
        path.write_text(f'@"{python}" -m ziglang {command} %*\n')
    else:
        path = folder / f"zig-{command}"
        path.write_text(f'#!/bin/sh\nexec "{python}" -m ziglang {command} "$@"\n')
        path.chmod(0o755)
    return path.as_posix()


def sources() -> list[Path]:
    """What the module is made of."""
    found = [ROOT / "CMakeLists.txt"]
    for folder in FOLDERS:
        for kind in ("*.cpp", "*.hpp"):
            found += (ROOT / folder).rglob(kind)
    return found


def is_current() -> bool:
    """Whether the checkout holds the module for this Python, newer than its sources."""
    for suffix in EXTENSION_SUFFIXES:
        module = ROOT / "pgm_places" / f"_core{suffix}"
        if module.exists():
            made = module.stat().st_mtime
            return all(source.stat().st_mtime <= made for source in sources())
    return False


def compile_in_place(python: str, *, tools: str = sys.executable) -> None:
    """Compile the module for ``python`` into the checkout."""
    start = time.perf_counter()
    module = built(python, tools, BUILD)
    target = ROOT / "pgm_places" / module.name
    beside = target.with_suffix(".new")
    shutil.copy(module, beside)
    beside.replace(target)  # programs that run keep the one they have loaded
    write_stub(python, _nanobind(tools).parent, module, ROOT / "pgm_places" / "_core.pyi")
    print(f"Compiled {target.relative_to(ROOT)} in {time.perf_counter() - start:.0f} s.")


def built(python: str, tools: str, folder: Path, *options: str) -> Path:
    """The module for ``python``, made in a folder with the packages next to ``tools``."""
    folder.mkdir(parents=True, exist_ok=True)
    configure = ["cmake", "-S", ROOT, "-B", folder, f"-DPython_EXECUTABLE={python}", *options]
    configure += [f"-Dnanobind_DIR={_nanobind(tools)}", "-DCMAKE_BUILD_TYPE=Release"]
    if shutil.which("ninja"):
        configure += ["-G", "Ninja"]
    with compiler(tools):
        if not has_compiler_of_before(folder):
            shutil.rmtree(folder)
        _quietly([*configure, *shlex.split(os.environ.get("CMAKE_ARGS", ""))])
        _quietly(["cmake", "--build", folder, "--parallel", str(os.cpu_count() or 1)])
    [module] = [path for path in folder.glob("_core.*") if path.suffix in (".so", ".pyd")]
    return module


def _nanobind(tools: str) -> Path:
    """The folder of what nanobind tells CMake."""
    asked = [tools, "-m", "nanobind", "--cmake_dir"]
    return Path(subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip())


def has_compiler_of_before(folder: Path) -> bool:
    """Whether the compiler that CMake remembers from the last time is still there."""
    cache = folder / "CMakeCache.txt"
    if not cache.exists():
        return True
    for line in cache.read_text().splitlines():
        if line.startswith("CMAKE_CXX_COMPILER:"):
            return Path(line.partition("=")[2]).exists()
    return True


def _quietly(command: list[object]) -> None:
    """Run a command; what it says is shown only where it fails."""
    words = list(map(str, command))
    done = subprocess.run(words, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode:
        sys.stderr.write(done.stdout)
        sys.exit(f"compiling the kernels failed: {' '.join(words)}")


def tools_python() -> str:
    """A Python of an environment with the tools, whose programs are on the path."""
    import tomllib  # not in the Pythons that pip then refuses

    if find_spec("nanobind") and shutil.which("cmake") and has_compiler():
        return sys.executable
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    wanted += [name for name in ("cmake", "ninja") if not shutil.which(name)]
    wanted += compiler_requirements()
    folder = ROOT / "build" / "core-tools"
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    python, listed = programs / "python", folder / "installed.txt"
    if not listed.exists() or not set(wanted) <= set(listed.read_text().splitlines()):
        venv.create(folder, with_pip=True, clear=True)
        install = [python, "-m", "pip", "install", "--quiet", *wanted]
        subprocess.run(list(map(str, install)), check=True)
        listed.write_text("\n".join(wanted))
    os.environ["PATH"] = f"{programs}{os.pathsep}{os.environ.get('PATH', '')}"
    return str(python)


def check_links(root: Path = ROOT) -> None:
    """End in one line where links to folders were checked out as text files."""
    broken = [name for name in LINKED if not (root / "pgm_places" / name).is_dir()]
    if broken:
        paths = " and ".join(f"pgm_places/{name}" for name in broken)
        links = "a symbolic link" if len(broken) == 1 else "symbolic links"
        sys.exit(
            f"{paths} must be {links} to the folders of the same names beside pgm_places, but this "
            "checkout has none (git on Windows, ZIP archives): run 'git config core.symlinks true' "
            f"and 'git checkout -- {paths.replace(' and ', ' ')}', on Windows in its developer mode"
        )


def announce() -> None:
    """Say in one line what is compiled with what, and how long it may take."""
    if has_compiler():
        print("Compiling the kernels of pgm_places (C++): about a minute ...", flush=True)
    else:
        print(
            "Compiling the kernels of pgm_places (C++) with zig from PyPI, as no compiler is"
            " installed: about three minutes, one from the second time on ...",
            flush=True,
        )


if __name__ == "__main__":
    check_links()
    if "--announce" in sys.argv[1:]:
        announce()
    elif "--if-changed" not in sys.argv[1:] or not is_current():
        announce()
        compile_in_place(sys.executable, tools=tools_python())
