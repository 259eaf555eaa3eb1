"""Pages: Jinja2 templates rendered to single self-contained HTML files."""

import base64
import hashlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from pgm_places._version import __version__

_TEMPLATES = Path(__file__).parent / "templates"
_NONE = "–"
_MOST_ITEMS, _MOST_NUMBERS = 24, 12


def render(
    template: str, *, folder: Path = _TEMPLATES, script: str | None = None, **values: object
) -> str:
    """The page rendered from a template and its values; all text is escaped.

    Parameters
    ----------
    template : str
        File name in ``folder``, or in the package's folder of templates.
    folder : Path
        A folder of further templates, which may extend those of the package.
    script : str or None
        File name of the page's only script; the page's content policy allows this one by its hash.
    values : object
        The variables of the template; an undefined variable is an error.
    """
    code = "" if script is None else template_text(script)
    digest = base64.b64encode(hashlib.sha256(code.encode("utf-8")).digest()).decode("ascii")
    page = (
        _environment(folder)
        .get_template(template)
        .render(script=code, script_digest=digest, version=__version__, **values)
    )
    return page.encode("utf-8", "replace").decode("utf-8")  # lone surrogates in file names


def template_text(name: str) -> str:
    """The text of a style sheet or script of the package."""
    return (_TEMPLATES / name).read_text("utf-8")


def data_uri(content: bytes, kind: str = "image/png") -> str:
    """The content as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


@lru_cache(maxsize=2)
def _environment(folder: Path) -> Environment:
    environment = Environment(
        loader=FileSystemLoader([folder, _TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "counted": lambda number, noun: f"{number:,} {noun}{'' if number == 1 else 's'}",
        "percent": percent,
        "spent": spent,
        "plain": _plain,
        "seconds": lambda value: _or_dash(value, ".2f" if value is None or value < 10 else ".1f"),
    }
    return environment


def _or_dash(value: float | None, form: str) -> str:
    return _NONE if value is None else f"{value:{form}}"


def percent(share: float | None, digits: int = 1) -> str:
    """A share in percent, a dash for None."""
    return _or_dash(None if share is None else 100 * share, f".{digits}f")


def decimals(value: float | None) -> str:
    """A number with three decimals, a dash for None."""
    return _or_dash(value, ",.3f")


def spent(seconds: float | None) -> str:
    """Seconds, a dash for None."""
    return "< 0.01" if seconds and seconds < 0.01 else _or_dash(seconds or None, ".2f")


def _plain(value: Any) -> str:
    """A value for display: short numbers, long arrays by their shape."""
    if isinstance(value, float | np.floating):
        return f"{float(value):.6g}"
    if isinstance(value, np.ndarray):
        large = value.size > _MOST_NUMBERS
        return f"array of shape {value.shape}" if large else _plain(value.tolist())
    if isinstance(value, list | tuple):
        shown = ", ".join(_plain(item) for item in value[:_MOST_ITEMS])
        return shown if len(value) <= _MOST_ITEMS else f"{shown} … ({len(value)} values)"
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {_plain(item)}" for key, item in value.items())
    return str(value)
