"""Machine code that a wheel brings is used where it holds, and nowhere else."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numba
import pytest
from llvmlite import binding

from pgm_places.kernels import shipped_code
from pgm_places.kernels.code_linker import ObjectCode, can_link
from pgm_places.kernels.jit import fused, njit
from pgm_places.kernels.kernel import Kernel
from tests.kernels.test_jit import cut, flip
from tests.kernels.test_machine_code import COMPILED, HELPER, PROGRAMS, STORED

START = """\
import sys
from pathlib import Path
from pgm_places.kernels import kernel, shipped_code

shipped_code.COMPILED = Path(__file__).with_name("compiled")
if "ship" in sys.argv:
    kernel.save_code = shipped_code.ship_code
import main
"""
FOR_THE_LEVEL = {
    "NUMBA_CPU_NAME": shipped_code.LEVEL,
    "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in shipped_code.FEATURES),
}


def can_run_the_level() -> bool:
    """Whether this is a processor, a system and a setting for what a wheel brings."""
    features = binding.get_host_cpu_features()
    return can_link() and all(features.get(name) for name in shipped_code.FEATURES)


only_where_it_runs = pytest.mark.skipif(
    not can_run_the_level(), reason="what a wheel brings does not run here"
)


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Programs with kernels, and their code as a wheel would have it."""
    folder = tmp_path_factory.mktemp("shipped")
    for name, text in {**PROGRAMS, "start": START}.items():
        (folder / f"{name}.py").write_text(text)
    assert run(folder, "ship", **FOR_THE_LEVEL) == COMPILED
    shutil.rmtree(folder / "cache")
    return folder


@pytest.fixture
def installed(shipped: Path, tmp_path: Path) -> Path:
    """The same somewhere else, with an empty cache."""
    return Path(shutil.copytree(shipped, tmp_path / "installed", copy_function=shutil.copyfile))


def run(folder: Path, *words: str, **changes: str) -> tuple[str, str]:
    """What the program prints, and its warnings."""
    ended = subprocess.run(
        [sys.executable, folder / "start.py", *words],
        capture_output=True,
        text=True,
        env={**os.environ, "PGM_PLACES_CACHE_DIR": str(folder / "cache"), **changes},
        check=True,
    )
    return ended.stdout, ended.stderr


def files(folder: Path) -> list[Path]:
    return sorted((folder / "compiled").glob("*/*"))


@only_where_it_runs
def test_a_first_run_elsewhere_compiles_nothing_and_keeps_nothing(installed: Path) -> None:
    assert run(installed) == STORED
    assert not list((installed / "cache").iterdir())


@only_where_it_runs
def test_no_folder_for_a_cache_is_needed(installed: Path) -> None:
    assert run(installed, PGM_PLACES_CACHE_DIR=str(installed / "main.py" / "below")) == STORED


@only_where_it_runs
def test_code_of_other_sources_is_refused(installed: Path) -> None:
    (installed / "helper.py").write_text(HELPER.replace("3.0", "10.0"))
    assert run(installed) == (COMPILED[0].replace("[3.5 6.5]", "[10.5 20.5]"), "")


@only_where_it_runs
def test_without_sources_kernels_are_compiled(
    shipped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = Kernel(lambda x: x)
    assert shipped_code.source_digest(kernel) is not None
    monkeypatch.setattr(shipped_code, "RULES", (shipped / "no.py",))
    assert shipped_code.source_digest(kernel) is None


@only_where_it_runs
@pytest.mark.parametrize("damage", [cut, flip])
def test_damaged_code_is_compiled_and_then_kept(
    damage: Callable[[bytes], bytes], installed: Path
) -> None:
    for path in files(installed):
        path.write_bytes(damage(path.read_bytes()))
    out, warned = run(installed)
    assert out == COMPILED[0]
    assert warned.count("RuntimeWarning: compiled kernels in") == 1
    assert run(installed) == STORED


@only_where_it_runs
def test_a_variable_that_changes_the_code_is_heeded(installed: Path) -> None:
    assert run(installed, NUMBA_OPT="3") == COMPILED


@only_where_it_runs
def test_anyone_may_read_what_is_installed(shipped: Path) -> None:
    assert {path.stat().st_mode & 0o777 for path in files(shipped)} == {0o644}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The empty folder of what a wheel has brought for this Python and numba."""
    monkeypatch.setattr(shipped_code, "COMPILED", tmp_path)
    made = shipped_code._folder()
    made.mkdir()
    shipped_code.shipped_folder.cache_clear()
    yield made
    shipped_code.shipped_folder.cache_clear()


@only_where_it_runs
def test_a_folder_is_used_where_all_fits(folder: Path) -> None:
    assert shipped_code.shipped_folder() == folder


@pytest.mark.parametrize("lacking", shipped_code.FEATURES)
def test_a_processor_that_lacks_anything_is_refused(
    lacking: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = dict.fromkeys(shipped_code.FEATURES, True) | {lacking: False}
    monkeypatch.setattr(binding, "get_host_cpu_features", lambda: found)
    assert shipped_code.shipped_folder() is None


def test_another_numba_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped_code, "numba_version", lambda: "0.60.0")
    assert shipped_code.shipped_folder() is None


@pytest.mark.parametrize("suffix", [".cpython-311d-x86_64-linux-gnu.so", ".cp311-win_amd64.pyd"])
def test_another_python_is_refused(
    suffix: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.machinery.EXTENSION_SUFFIXES", [suffix])
    assert shipped_code.shipped_folder() is None


@fused
def _anyhow(x: float) -> float:
    return x + 1.0 + x


@njit(fastmath=True)
def _fast(x: float) -> float:
    return _anyhow(x)


def test_code_whose_bits_depend_on_the_processor_is_not_shipped(folder: Path) -> None:
    assert isinstance(_fast, Kernel)
    code = ObjectCode("wrapper", "environment", (), {}, b"")
    with pytest.raises(ValueError, match="_fast lets the compiler choose the order of sums"):
        shipped_code.ship_code(_fast, "float", code)
    assert not list(folder.iterdir())


def test_the_names_of_the_builders_folders_are_not_shipped(folder: Path) -> None:
    kernel = Kernel(lambda x: x)
    places = [shipped_code.__file__, numba.__file__]
    objects = {"00": ["ValueError", ["negative"], ["f", places[0], 3]]}
    code = ObjectCode("wrapper", "environment", (), objects, "".join(places).encode())
    shipped_code.ship_code(kernel, "int", code)
    [path] = folder.iterdir()
    stored = path.read_bytes()
    assert stored.count(b"//pgm_places/kernels/shipped_code.py") == 2
    for place in places:
        assert str(Path(place).parents[1]).encode() not in stored
