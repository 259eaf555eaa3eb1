"""``python -m tests.mutation MODULE.py TESTS...``: change the code, and see whether tests notice.

Each change is made in a process of its own, forked once everything is imported.
"""

import argparse
import ast
import contextlib
import importlib
import os
import random
import resource
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import pytest

from tests.mutation.changes import changed_code, changes_of

SECONDS = 60
"""Of processor time for the tests of a change; then it counts as noticed."""


def main() -> None:
    """A line for each change that no test noticed, and the score."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("module", type=Path, help="such as solvers/marginal_lp.py")
    parser.add_argument("tests", nargs="+", help="files of tests, or tests in them")
    parser.add_argument("--count", type=int, default=50, help="changes to try, drawn by chance")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--lines", default="1-100000", help="of the module, such as 120-160")
    options = parser.parse_args()
    tree = ast.parse(options.module.read_text(encoding="utf-8"))
    first, last = map(int, options.lines.split("-"))
    possible = [
        change
        for change in changes_of(tree)
        if first <= int(change[2].split(":")[0].removeprefix("line ")) <= last
    ]
    drawn = random.Random(options.seed).sample(possible, min(options.count, len(possible)))
    module = _imported(options.module)
    with _silence():
        pytest.main([*options.tests, "--collect-only", "-q"])
    if not _passes(options.tests, None, module):
        sys.exit("the tests fail without any change")
    survivors = []
    for change in sorted(drawn):
        if _passes(options.tests, changed_code(tree, change, str(options.module)), module):
            survivors.append(change)
            print(f"{options.module}, {change[2]}", flush=True)  # noqa: T201
    noticed = len(drawn) - len(survivors)
    print(f"{noticed} of {len(drawn)} noticed, {len(possible)} possible")  # noqa: T201


def _imported(path: Path) -> ModuleType:
    parts = path.with_suffix("").parts
    return importlib.import_module(
        ".".join(parts if parts[0] == "pgm_places" else ("pgm_places", *parts))
    )


def _passes(tests: list[str], code: CodeType | None, module: ModuleType) -> bool:
    """Whether the tests pass in a process of its own, with other code in the module."""
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with _silence():
            if code is not None:
                _put(code, vars(module))
            status = pytest.main([*tests, "-x", "-q", "-p", "no:cacheprovider"])
        os._exit(int(status))
    return os.waitpid(child, 0)[1] == 0


def _put(code: CodeType, names: dict[str, Any]) -> None:
    """Give the functions and methods of a module the code of their names."""
    for part in code.co_consts:
        if not isinstance(part, CodeType) or part.co_name not in names:
            continue
        found = names[part.co_name]
        if isinstance(found, type):
            _put(part, dict(vars(found)))
            continue
        found = getattr(found, "fget", None) or getattr(found, "__func__", found)
        found = getattr(found, "func", found)  # of a cached property
        while hasattr(found, "__wrapped__"):
            found = found.__wrapped__
        if hasattr(found, "__code__"):
            found.__code__ = part


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    with (
        Path(os.devnull).open("w") as null,
        contextlib.redirect_stdout(null),
        contextlib.redirect_stderr(null),
    ):
        yield


if __name__ == "__main__":
    main()
