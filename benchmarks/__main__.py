"""Run benchmarks and write ``docs/benchmarks.md``: ``python -m benchmarks [topics] [--quick]``.

Each topic's section is kept, so that the page always contains all of them; with ``--quick`` nothing
is kept.
"""

import argparse
import importlib
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from llvmlite import binding

from pgm_places.experiment.runs import versions

TOPICS = (
    "first_use",
    "casting",
    "features",
    "boosting",
    "boosted_trees",
    "spaces",
    "labelling",
    "large_map",
    "relaxation",
    "inference",
    "distances",
    "amn_learning",
    "forward",
    "problems",
    "tagging",
    "tracking",
    "topology",
    "teaching",
    "batch",
    "live",
    "live_dating",
    "live_updates",
)
FOLDER = Path(__file__).resolve().parent
SECTIONS = FOLDER / "sections"  # what each topic wrote last
KERNELS = FOLDER / "kernels.md"  # those in C++ beside numba's, which they replaced
NOTES = FOLDER / "notes.md"  # the targets, and what limits those that were missed
PAGE = FOLDER.parent / "docs" / "benchmarks.md"
HEAD = """\
# Benchmarks

Each table compares methods side by side in one run on the same data.
Machines differ and shared ones are noisy: look at ratios, and compare only within a table. The
sections were measured at different times on a shared machine whose speed varied by a factor of 3.
Times are medians of repeated runs after a warm-up that compiles the kernels: processor time on one
thread, wall clock on several, unless a column says otherwise. A section that names no machine was
measured on two cores of an AMD EPYC with Python 3.11, NumPy 2.4 and numba 0.68.

"""
HOW_TO_RUN = """\
To run all of them: `make bench` or `python -m benchmarks`. Peers that are not installed are omitted
from the tables; `pip install lightgbm "opencv-python-headless<5" hmmlearn PyMaxflow gco-wrapper
ortools pgmax "jax<0.7"` installs them all (some are GPL: used for comparison only, never as
dependencies).
"""


def processor() -> str:
    """The processor's name where the system tells it."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def vectors() -> str:
    """The kind of processor that kernels are compiled for, and its widest vectors."""
    features = binding.get_host_cpu_features()
    known = {"avx512f": "AVX-512", "avx2": "AVX2", "neon": "NEON"}
    widest = (words for name, words in known.items() if features.get(name))
    return ", ".join([binding.get_host_cpu_name(), *list(widest)[:1]])


def machine() -> str:
    """What the figures of a section were measured with."""
    known = ", ".join(f"{name} {version}" for name, version in versions().items())
    return f"Machine: {processor()} ({vectors()}), {os.cpu_count()} cores. Versions: {known}."


def markdown_table(rows: Sequence[dict[str, Any]]) -> str:
    """Rows as a table; a row with other columns than the one before starts another table."""
    lines: list[str] = []
    columns: list[str] = []
    for row in rows:
        if list(row) != columns:
            columns = list(row)
            lines += ["", "| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines.append("| " + " | ".join(_text(row[name]) for name in columns) + " |")
    return "\n".join(lines)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    return str(value)


def section(topic: str, *, quick: bool) -> str:
    """One topic's heading, explanation, command and table."""
    module = importlib.import_module(f"benchmarks.{topic}")
    text = (module.__doc__ or "").strip()
    title, _, body = text.partition("\n")
    rows = module.run(quick)
    return (
        f"## {title.rstrip('.')}\n\n{body.strip()}\n\n"
        f"```console\n$ python -m benchmarks.{topic}\n```\n\n{machine()}\n{markdown_table(rows)}\n"
    )


def main() -> None:
    """Parse arguments, run, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("topics", nargs="*", help=f"some of {', '.join(TOPICS)}; all by default")
    parser.add_argument("--quick", action="store_true", help="small sizes, to see that it runs")
    arguments = parser.parse_args()
    for topic in arguments.topics or TOPICS:
        print(f"== {topic}", flush=True)
        text = section(topic, quick=arguments.quick)
        print(text, flush=True)
        if not arguments.quick:
            SECTIONS.mkdir(exist_ok=True)
            (SECTIONS / f"{topic}.md").write_text(text, encoding="utf-8")
    if not arguments.quick:
        PAGE.write_text(page(), encoding="utf-8")
        print(f"wrote {PAGE}")


def page() -> str:
    """The page of all sections that were kept."""
    parts = [HEAD + HOW_TO_RUN]
    files = (*(SECTIONS / f"{topic}.md" for topic in TOPICS), KERNELS, NOTES)
    return "\n".join(
        [*parts, *(file.read_text(encoding="utf-8") for file in files if file.exists())]
    )


if __name__ == "__main__":
    main()
