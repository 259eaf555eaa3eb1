"""Optional dependencies: imported on use, with a message that names the extra to install."""

import importlib
from pathlib import Path
from typing import Any

from pgm_places.errors import InputError


def needed(module: str, *, extra: str, purpose: str) -> Any:
    """The module of an optional package, which the ``extra`` of this package installs.

    InputError if it is not installed; the message begins with the ``purpose`` and says how to
    install it.

    Examples
    --------
    >>> needed("json", extra="none", purpose="reading JSON").loads("[1]")
    [1]
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(
            f"{purpose} needs the package {module.partition('.')[0]!r} ({error}); install it with: "
            f"{install_command(extra)}"
        ) from None


def install_command(extra: str) -> str:
    """The pip command that installs an extra, of the checkout or of the installed package.

    Examples
    --------
    >>> install_command("studio").startswith(("pip install --editable", "pip install pgm-places"))
    True
    """
    root = Path(__file__).resolve().parents[1]
    if (root / "pyproject.toml").is_file():
        return f'pip install --editable "{root}[{extra}]"'
    return f'pip install "pgm-places[{extra}]"'
