"""Tables of all methods on the drives of the configurations in ``experiments/drives``.

``PGM_PLACES_DATA=DATA python -m experiments.trajectories`` prints all, or the named ones;
``--write-docs`` renews them in docs/results.md. ``--kept FOLDER`` stores the results of each part,
and of each graph of the part ``graphs``, so that an interrupted run resumes.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from experiments.array_cache import fingerprint
from experiments.page_tables import SideBySide, parsed_tables, show_table, text_of, with_write_docs
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult, score_intervals
from pgm_places.experiment.config import ExperimentConfig, load_config
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare
from pgm_places.io.atomic import write_text
from pgm_places.spaces.doorways import DoorScores

TABLES = ("methods", "graphs")
FOLDER = Path(__file__).parent / "drives"
DRIVES = ("building79", "categories79", "simulated", "cold_freiburg", "cold_saarbrucken")
LOOP_M = 0.4
CHAIN, LOOPS, JOINT = "chain", "chain with loops", "joint with the cells"
CHAINS_ONLY = ("hmm", "semi_markov")
COLUMNS = "method | accuracy | 95 % | balanced | doorway recall | passages found | invented |"
GRAPHS = (
    SideBySide(("method",), "{drives}", f"{{{CHAIN}}}"),
    SideBySide(("method",), "{drives}: with loops", f"{{{LOOPS}}}"),
    SideBySide(("method",), "{drives}: with the cells", f"{{{JOINT}}}"),
)
"""How the long table of the graphs is made short and wide."""


@dataclass(frozen=True)
class TextCache:
    """Cache of named texts in files of a folder; caches nothing without a folder.

    Parameters
    ----------
    folder : Path or None
        Made if there is none.
    """

    folder: Path | None = None

    def text(self, name: str, make: Callable[[], str]) -> str:
        """The text of that name, made by ``make`` if there is no file of it."""
        if self.folder is None:
            return make()
        path = self.folder / f"{name}.md"
        if not path.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            write_text(path, make())
        return path.read_text(encoding="utf-8")


def methods_table(name: str) -> str:
    """Accuracy, balanced accuracy, doorway recall and passages of each method of a file here."""
    found = _compared(name)
    lines = [f"| {COLUMNS}", "|---" * 7 + "|"]
    lines += [f"| {_figures_of(found, method)}" for method in found.methods]
    return "\n".join(lines)


def _compared(name: str) -> Comparison:
    return compare(Experiment(load_config(FOLDER / name), FOLDER))


def _figures_of(found: Comparison, method: MethodResult) -> str:
    """A method's row over all drives, its interval by stretches of their ways."""
    scored = Evaluation.merged(method.evaluations)
    items, labelings = found.maps, [method.labelings]
    interval = score_intervals(items, labelings, len(found.label_names))["accuracy"]
    doors = DoorScores.total(method.doors)
    text = (
        f"`{method.id}` | {100 * scored.accuracy:.1f} | "
        f"{100 * interval.low:.1f} to {100 * interval.high:.1f} | "
        f"{100 * scored.balanced_accuracy:.1f} | "
        f"{100 * (scored.recall['doorway'] or 0.0):.1f} | "
        f"{doors.found} of {doors.doors} | {doors.invented} |"
    )
    print(text, flush=True)
    return text


def graphs_table(cache: TextCache, names: tuple[str, ...] = DRIVES) -> str:
    """Accuracy / balanced accuracy of every method on every graph, drives by drives."""
    lines = [f"| drives | method | {CHAIN} | {LOOPS} | {JOINT} |", "|---|---|---|---|---|"]
    for name in names:
        lines += _rows(name, load_config(FOLDER / f"{name}.toml"), cache)
    return "\n".join(lines)


def _rows(name: str, config: ExperimentConfig, cache: TextCache) -> Iterator[str]:
    """A row per method; methods for chains have the first graph alone."""
    loopy = tuple(item for item in config.methods if item.name not in CHAINS_ONLY)
    variants = {CHAIN: config}
    variants[LOOPS] = replace(changed_config(config, {"steps.loop_m": LOOP_M}), methods=loopy)
    if "room" in config.labels.names:  # categories are labels of steps, and not of the cells
        drives = tuple(item for item in config.train if item.is_drive)  # each with its map
        variants[JOINT] = replace(config, nodes="both", train=drives, methods=loopy)
    found = {}
    for graph, variant in variants.items():
        stem = f"{name}-{graph.replace(' ', '-')}-{fingerprint(variant)}"
        text = cache.text(stem, partial(_figures, variant))
        print(f"{config.title}, {graph}\n{text}", flush=True)
        found[graph] = dict(line.split("\t") for line in text.splitlines())
    for method in config.methods:
        cells = [found.get(graph, {}).get(method.id, "-") for graph in (CHAIN, LOOPS, JOINT)]
        yield f"| {config.title} | `{method.id}` | {' | '.join(cells)} |"


def _figures(config: ExperimentConfig) -> str:
    """A line per method: its name, a tab, accuracy / balanced accuracy of the steps in percent."""
    found = compare(Experiment(config, FOLDER))
    lines = []
    for method in found.methods:
        item = found.by_unit(method)["step"]
        figures = f"{100 * item.accuracy:.1f} / {100 * item.balanced_accuracy:.1f}"
        lines.append(f"{method.id}\t{figures}")
    return "\n".join(lines) + "\n"


def graphs_shown(text: str) -> str:
    """The table of the graphs as the page shows it, without rows that have no figures."""
    [table] = parsed_tables(text)
    wide = [layout.of(table) for layout in GRAPHS]
    shown = [replace(item, rows=tuple(filter(_has_figures, item.rows))) for item in wide]
    return text_of([item for item in shown if item.rows])


def _has_figures(row: Sequence[str]) -> bool:
    return any(any(map(str.isdigit, cell)) for cell in row[1:])


def parser() -> argparse.ArgumentParser:
    """The arguments of the command."""
    result = with_write_docs(argparse.ArgumentParser(prog="python -m experiments.trajectories"))
    result.add_argument("--kept", type=Path, help="folder for cached results")
    result.add_argument(
        "parts", nargs="*", choices=[*TABLES, []], metavar="part", help=", ".join(TABLES)
    )
    return result


def main() -> None:
    """Run the named parts, or all, and write their tables."""
    chosen = parser().parse_args()
    if not os.environ.get("PGM_PLACES_DATA"):
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    cache = TextCache(chosen.kept)
    parts: Mapping[str, Callable[[], str]] = {
        "methods": lambda: cache.text("methods", lambda: methods_table("building79.toml")),
        "graphs": lambda: graphs_shown(cache.text("graphs", lambda: graphs_table(cache))),
    }
    for name in chosen.parts or TABLES:
        show_table(name, parts[name](), write=chosen.write_docs)


if __name__ == "__main__":
    main()
