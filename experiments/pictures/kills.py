"""The picture of reliability: what a folder holds after a writer is killed at each of its steps."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray

from experiments.pictures.kept import figure, keep
from pgm_places.io.output_set import output_set
from pgm_places.palette import LABEL_COLOURS
from pgm_places.pictures.drawing import INK, MUTED
from tests.faults.steps import count_steps, killed_at

FILES = ("labels.png", "labels.yaml", "overview.png", "summary.json")
RUNS = ("old", "new")
KINDS = ("the earlier run's", "the killed run's")
COLOURS = LABEL_COLOURS[1::-1]


def as_a_set(folder: Path, run: str) -> None:
    """The package's way."""
    with output_set(folder, "picture", names=FILES) as files:
        for name in FILES:
            _write(files.stage / name, run)


def one_by_one(folder: Path, run: str) -> None:
    """The plain way: open each file and write it."""
    if not folder.exists():
        folder.mkdir()
    for name in FILES:
        _write(folder / name, run)


def _write(path: Path, run: str) -> None:
    path.write_text(run, encoding="utf-8")


def kills(write: Callable[[Path, str], None], where: Path) -> NDArray[Any]:
    """(files, steps) index into ``KINDS`` after a kill at each step of the second run."""
    counted = where / "counted"
    write(counted, "old")
    n_steps = count_steps(partial(write, counted, "new"))
    left = np.zeros((len(FILES), n_steps), int)
    for number in range(1, n_steps + 1):
        folder = where / str(number)
        write(folder, "old")
        assert killed_at(number, partial(write, folder, "new"))
        for row, name in enumerate(FILES):
            left[row, number - 1] = RUNS.index((folder / name).read_text(encoding="utf-8"))
    return left


def reliability() -> None:
    """Two ways of writing four files, each killed at every step."""
    picture = figure(10, 3.6)
    axes = picture.subplots(2, 1)
    titles = {
        one_by_one: "files written one after another: a kill leaves a mixture",
        as_a_set: "as the commands write them: one run's files, whenever it is killed",
    }
    os_fsync, os.fsync = os.fsync, lambda _: None  # no power fails here, and it is slow
    for axis, (write, title) in zip(axes, titles.items(), strict=True):
        with TemporaryDirectory() as name:
            left = kills(write, Path(name))
        _draw(axis, left, title)
        print(title, [sorted({RUNS[run] for run in column}) for column in left.T])
    os.fsync = os_fsync
    for name, colour in zip(KINDS, COLOURS, strict=True):
        axes[1].scatter([], [], marker="s", c=colour, s=60, label=name)
    picture.legend(loc="outside lower left", ncols=3, frameon=False, fontsize=10)
    keep("reliability", picture)


def _draw(axis: Axes, left: NDArray[Any], title: str) -> None:
    n_files, n_steps = left.shape
    axis.pcolormesh(left, cmap=ListedColormap(COLOURS), vmin=0, vmax=1, edgecolors="white", lw=2)
    axis.set_yticks(np.arange(n_files) + 0.5, FILES, fontsize=9)
    axis.set_xticks(np.arange(n_steps) + 0.5, [str(k) for k in range(1, n_steps + 1)], fontsize=8)
    axis.invert_yaxis()
    axis.tick_params(length=0, colors=MUTED)
    axis.spines[:].set_visible(False)
    axis.set_xlabel("the step that it was killed at", fontsize=9, color=MUTED)
    axis.set_title(title, loc="left", fontsize=10.5, color=INK)
