"""Run benchmarks and write their tables into docs/benchmarks.md: python -m benchmarks [topics].

With ``--quick``, sizes are small and nothing is written.
"""

import argparse
import importlib
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.page_tables import SideBySide, text_of, write_table
from experiments.paper.section import Table
from pgm_places._core import widest_registers
from pgm_places.experiment.runs import versions

TOPICS = (
    "casting",
    "features",
    "boosting",
    "labelling",
    "large_map",
    "relaxation",
    "inference",
    "amn_learning",
    "forward",
    "tagging",
    "tracking",
    "batch",
    "live",
)
TABLES = TOPICS
"""Their names in the marks of docs/benchmarks.md."""


def processor() -> str:
    """The processor's name where the system tells it."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def vectors() -> str:
    """The widest vectors that kernels use."""
    return {64: "AVX-512", 32: "AVX2"}.get(widest_registers(), platform.machine())


def machine() -> str:
    """What the figures of a table were measured with."""
    known = versions()
    named = f"Python {known['python']}, NumPy {known['numpy']}, pgm_places {known['pgm-places']}"
    return f"*{processor()} ({vectors()}), {os.cpu_count()} cores; {named}.*"


def markdown_tables(rows: Sequence[dict[str, Any]], shown: Sequence[SideBySide] = ()) -> str:
    """Rows as tables: one for those of the same columns."""
    groups: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for row in rows:
        groups.setdefault(tuple(row), []).append(tuple(map(_text, row.values())))
    tables = []
    for columns, texts in groups.items():
        table = Table("", columns, tuple(texts))
        fitting = next((item for item in shown if item.fits(table.heading)), None)
        tables.append(table if fitting is None else fitting.of(table))
    return text_of(tables)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    return str(value)


def measured(topic: str, *, quick: bool) -> str:
    """A topic's tables and the machine."""
    module = importlib.import_module(f"benchmarks.{topic}")
    tables = markdown_tables(module.run(quick), getattr(module, "SHOWN", ()))
    return f"{tables}\n{machine()}"


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    result = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    result.add_argument(
        "topics", nargs="*", choices=[*TOPICS, []], metavar="topic", help=", ".join(TOPICS)
    )
    result.add_argument("--quick", action="store_true", help="small sizes, to see that it runs")
    return result


def main() -> None:
    """Run the named topics, or all, and write their tables."""
    arguments = parser().parse_args()
    for topic in arguments.topics or TOPICS:
        print(f"== {topic}", flush=True)
        text = measured(topic, quick=arguments.quick)
        print(text, flush=True)
        if not arguments.quick:
            write_table(topic, text)


if __name__ == "__main__":
    main()
