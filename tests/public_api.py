"""The public names with their signatures; python -m tests.public_api writes them down."""

import dataclasses
import inspect
from enum import Enum
from pathlib import Path
from typing import Any

import pgm_places

RECORD = Path(__file__).parent / "public_api.txt"


def lines_of(name: str, found: Any) -> list[str]:
    """A name with its signature, and below it those of a class's own public members."""
    if not inspect.isclass(found):
        return [f"{name}{_parameters(found)}"]
    if issubclass(found, Enum):
        return [f"{name}: {', '.join(member.name for member in found)}"]
    lines = [name if issubclass(found, Exception) else f"{name}{_parameters(found)}"]
    for key, member in sorted(_members(found).items()):
        if key.startswith("_") or key in _field_names(found):
            continue
        if isinstance(member, classmethod | staticmethod):
            lines.append(f"  {name}.{key}{_parameters(member.__func__)}")
        elif inspect.isfunction(member):
            lines.append(f"  {name}.{key}{_parameters(member)}")
        else:
            lines.append(f"  {name}.{key}")
    return lines


def _members(found: Any) -> dict[str, Any]:
    """What a class offers, with what it has from bases of this package."""
    own = [base for base in found.__mro__ if base.__module__.startswith("pgm_places")]
    return {key: member for base in reversed(own) for key, member in vars(base).items()}


def _parameters(function: Any) -> str:
    """The parameters by name, kind and whether they have a default; defaults may be tuned."""
    try:
        signature = inspect.signature(function)
    except ValueError:
        return ""
    parts, bare_star = [], False
    for item in signature.parameters.values():
        if item.kind is item.KEYWORD_ONLY and not bare_star:
            bare_star = True
            parts.append("*")
        text = item.name if item.default is item.empty else f"{item.name}=..."
        stars = "*" * (item.kind is item.VAR_POSITIONAL) + "**" * (item.kind is item.VAR_KEYWORD)
        parts.append(stars + text)
    return f"({', '.join(part for part in parts if part not in ('self', 'cls'))})"


def _field_names(found: Any) -> set[str]:
    """Fields of a dataclass are in its signature already."""
    return (
        {item.name for item in dataclasses.fields(found)}
        if dataclasses.is_dataclass(found)
        else set()
    )


def public_api() -> str:
    """Every name of the package with its members, in order."""
    names = sorted(set(pgm_places.__all__) - {"__version__"})
    lines = [line for name in names for line in lines_of(name, getattr(pgm_places, name))]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    RECORD.write_text(public_api(), encoding="utf-8")
