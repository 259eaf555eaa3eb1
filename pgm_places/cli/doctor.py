"""``pgm-places doctor``: checks maps, or the installation."""

import contextlib
import platform
import re
from pathlib import Path
from typing import Annotated

from pgm_places._version import __version__
from pgm_places.cli.arguments import Model, UnknownValue
from pgm_places.cli.declarations import Argument
from pgm_places.cli.entry import EXIT_MAPS_FAILED
from pgm_places.cli.terminal import say, text_table
from pgm_places.errors import InputError
from pgm_places.options import UnknownGrey

_SOLVERS = {"clarabel", "ortools"}
"""Optional packages without an extra of this package: solvers of cvxpy and of decoders."""


def doctor(
    maps: Annotated[list[str] | None, Argument("MAP.yaml...")] = None,
    fix: bool = False,
    model: Model = "default",
    unknown_value: UnknownValue = None,
) -> None:
    """Check maps or, without any, the installation.

    For several maps, a table shows how many cells each has at the model's resolution, and roughly
    how long labelling them takes on this machine. The exit code is 3 if some map cannot be
    labelled.

    Parameters
    ----------
    maps
        Maps to check; several, folders or quoted patterns give a table.
    fix
        Correct YAML files whose thresholds misread unknown cells or walls, or whose image path is
        wrong although the image is in the same folder; the original is saved as FILE.orig.
    """
    if fix and not maps:
        raise InputError("--fix needs maps; name one, or a folder")
    if maps:
        _maps(maps, model, unknown_value, fix=fix)
    else:
        _environment()


def _environment() -> None:
    """Print the installed packages and plugins."""
    from pgm_places.features.custom import FEATURES
    from pgm_places.inference.backends import backend_names
    from pgm_places.kernels.threads import resolve_threads
    from pgm_places.models.decoders import decoder_names

    rows = [["package", "version"], ["pgm-places", __version__]]
    rows += [["python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"]]
    rows += [[name, _version(name.partition(" ")[0])] for name in _packages()]
    say(text_table(rows))
    say(f"\nmethods: {', '.join(backend_names())}")
    say(f"decoders: {', '.join(decoder_names())}")
    say(f"custom features: {', '.join(FEATURES.names()) or 'none installed'}")
    say(f"threads: {resolve_threads()}")


def _maps(maps: list[str], model: str, unknown_value: UnknownGrey | None, *, fix: bool) -> None:
    from pgm_places.batch.found_maps import names_many
    from pgm_places.cli.doctor_maps import check_map, check_maps
    from pgm_places.trained import stored_labeler

    if len(maps) == 1 and not names_many(maps[0]):
        check_map(Path(maps[0]), stored_labeler(model).item, unknown_value, fix=fix)
    elif not check_maps(maps, model, unknown_value, fix=fix):
        raise SystemExit(EXIT_MAPS_FAILED)


def _packages() -> list[str]:
    """Required packages, from the metadata, then optional ones."""
    from importlib.metadata import PackageNotFoundError, requires

    needs: list[str] = []
    with contextlib.suppress(PackageNotFoundError):  # a checkout that is not installed
        needs = requires("pgm-places") or []
    listed = {re.split(r"[^\w.-]", text)[0]: "extra ==" in text for text in reversed(needs)}
    optional = {name for name, is_extra in listed.items() if is_extra} | _SOLVERS
    required = sorted(listed.keys() - optional)
    return [*required, *(f"{name} (optional)" for name in sorted(optional))]


def _version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # slow to import

    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
