"""Write pgm_places/_core.pyi, the type stub of the kernels, by ``make core``."""

import re
import subprocess
from pathlib import Path

HEAD = """\
# Written by tools/stub.py from the compiled module.
from typing import Any, overload

import numpy
from numpy.typing import NDArray

"""
ARRAY = re.compile(r"array\[(\w+), ndim=\d+(?:, writable)?\]")
NUMBER = {"float": "float | numpy.floating", "int": "int | numpy.integer"}


def write_stub(python: str, nanobind: Path, module: Path, target: Path) -> None:
    """Write what nanobind's program finds in a compiled module, with NumPy's types of arrays.

    The kernels work without it, so that one line tells of a failure and nothing ends.
    """
    command = [python, nanobind / "stubgen.py", "--quiet", "--exclude-docstrings"]
    command += ["--import", module.parent, "--module", "_core", "--output-file", target]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode:
        reason = done.stderr.strip().rpartition("\n")[2]
        print(f"mypy will not know the kernels: {target.name} was not written ({reason}).")
        target.unlink(missing_ok=True)
        return
    target.write_text(with_numpy_types(target.read_text(encoding="utf-8")), encoding="utf-8")


def with_numpy_types(stub: str) -> str:
    """The stub with NumPy's words for ``array[float32, ndim=2, writable]``, as kernels say it.

    Dimensions are left out, which most arrays' types do not tell; so are the kernels that differ in
    nothing else.
    """
    signatures: dict[str, list[str]] = {}
    for line in stub.splitlines():
        if line.startswith("def "):
            found = signatures.setdefault(line[4 : line.index("(")], [])
            signature = _signature(line)
            if signature not in found:
                found.append(signature)
    blocks = []
    for found in signatures.values():
        blocks += [f"@overload\n{one}" for one in found] if len(found) > 1 else found
    return HEAD + "\n".join(blocks) + "\n"


def _signature(line: str) -> str:
    """One kernel's line."""
    arguments, arrow, result = line.partition(" -> ")
    arguments = re.sub(r"\b(float|int)\b", lambda word: NUMBER[word[0]], arguments)
    arguments = ARRAY.sub(r"NDArray[numpy.\1]", arguments)
    result = re.sub(r"\barray\b", "NDArray[Any]", result)
    return arguments + arrow + result.removesuffix(" ...") + " ..."
