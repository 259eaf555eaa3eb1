"""Console output with control characters escaped, tables as text, and progress bars."""

import contextlib
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pgm_places.errors import OutputError, escape_control
from pgm_places.progress import Silent, Stage

if TYPE_CHECKING:
    from rich.progress import Progress

    from pgm_places.experiment.comparison import Comparison
    from pgm_places.io.output_set import OutputSet


_LONGEST = 2000


def say(text: str) -> None:
    """Print lines to standard output and flush it."""
    try:
        sys.stdout.write(escape_control(text, keep="\n") + "\n")
        sys.stdout.flush()  # pipes receive each line immediately
    except BrokenPipeError:  # the reader closed the pipe: not an error
        raise
    except OSError as error:
        raise OutputError(
            f"cannot write to standard output: {error.strerror or error}; check the free space"
        ) from None


def say_written(files: "OutputSet") -> None:
    """Print a line for each file that was written."""
    for path in files.written:
        say(f"wrote {path}")


def say_next(*lines: str) -> None:
    """Print the next commands, as lines that can be copied; nothing without any."""
    if not lines:
        return
    say("\n".join(("\nNext:", *(f"  {line}" for line in lines))))


def warn(message: str) -> None:
    """Print a warning to standard error, as one line."""
    complain(f"warning: {message}")


def complain(message: str) -> None:
    """Print a message to standard error, as one line of bounded length."""
    text = escape_control(message)
    if len(text) > _LONGEST:
        text = f"{text[:_LONGEST]} ..."
    with contextlib.suppress(OSError, ValueError):  # stream full or closed: cannot report it
        print(text, file=sys.stderr, flush=True)  # noqa: T201


def make_progress(*, quiet: bool) -> "BarProgress | QuietProgress":
    """Bars if standard error is a terminal, lines if it is not, only warnings if ``quiet``."""
    if quiet:
        return QuietProgress()
    return BarProgress() if sys.stderr.isatty() else LineProgress()


class QuietProgress(Silent):
    """Warnings only."""

    def warn(self, message: str) -> None:
        """Print the warning."""
        warn(message)


class LineProgress(QuietProgress):
    """One line per stage when it ends, for logs and pipes."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Stage]:
        """Print the stage's name and its seconds when it ends."""
        start = time.perf_counter()
        yield Silent()
        complain(f"{name}: {time.perf_counter() - start:.1f} s")


class _Bar:
    def __init__(self, progress: "Progress", task: int) -> None:
        self._progress, self._task = progress, task

    def update(self, fraction: float, note: str = "") -> None:
        fields = {"note": note} if note else {}
        self._progress.update(self._task, completed=fraction, **fields)  # type: ignore[arg-type]


class BarProgress:
    """One bar per stage; finished stages stay as a line with their time."""

    def __init__(self) -> None:
        from rich.console import Console

        self._console = Console(stderr=True)

    @contextmanager
    def stage(self, name: str) -> Iterator[Stage]:
        """Show a bar until the stage ends."""
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (
            TextColumn("{task.description:<28}"),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            TextColumn("{task.fields[note]}"),
        )
        with Progress(*columns, console=self._console) as progress:
            task = progress.add_task(name, total=1.0, note="")
            yield _Bar(progress, task)
            progress.update(task, completed=1.0)

    def warn(self, message: str) -> None:
        """Print the warning above the bars."""
        text = escape_control(f"warning: {message}")
        self._console.print(text, style="yellow", markup=False, highlight=False)


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Rows as aligned columns, the first left, the others right; the first row is the heading."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for index, row in enumerate(rows):
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
        if index == 0:
            lines.append("  ".join("-" * width for width in widths))
    return "\n".join(lines)


_IN_TERMINALS = ("results", "differences", "by_label", "doors", "by_split", "by_unit")


def comparison_table(comparison: "Comparison") -> str:
    """The main tables of a comparison, then the options chosen on training data, as text."""
    from pgm_places.report.comparison_tables import comparison_tables

    tables = comparison_tables(comparison)
    parts = [
        f"{tables[name].caption}\n\n{text_table(tables[name].as_words())}"
        for name in _IN_TERMINALS
        if name in tables
    ]
    stages = ", ".join(f"{name} {value:.1f} s" for name, value in comparison.stage_seconds.items())
    note = f"* significantly better{_units(comparison)}, or the highest of a split"
    note += "; ranges: 95 % intervals"
    n_seeds = len(comparison.seeds)
    note += f"; ±: standard deviation over {n_seeds} seeds" if n_seeds else ""
    parts.append(f"({note}; stages: {stages})")
    chosen = [f"{option}: {words}" for option, words in comparison.all_choices.items()]
    return "\n" + "\n\n".join(parts) + "".join(f"\n{line}" for line in chosen)


def _units(comparison: "Comparison") -> str:
    """What differences are tested on, if the buildings are too few for the test over buildings."""
    from pgm_places.experiment.significance import FEWEST_BUILDINGS

    differences = comparison.judgement.differences
    n = differences[0].buildings.n_buildings if differences else FEWEST_BUILDINGS
    if n >= FEWEST_BUILDINGS:
        return ""
    which = "the test building" if n == 1 else f"the {n} test buildings"
    return f" on blocks of {which}, which says nothing of others"


def shares_line(fractions: "tuple[float, float, float]") -> str:
    """The shares of free, occupied and unknown cells."""
    free, occupied, unknown = fractions
    return (
        f"map: {100 * free:.1f} % free, {100 * occupied:.1f} % occupied, "
        f"{100 * unknown:.1f} % unknown"
    )
