"""Paths of a configuration: relative to its folder, or below a folder that a variable names."""

import os
from pathlib import Path

from pgm_places.errors import ConfigError
from pgm_places.io.input_file import user_path


def resolved_path(name: str, folder: Path) -> Path:
    """The path that a configuration in ``folder`` names.

    A leading ``$NAME`` is replaced by that environment variable, taken as a folder.

    Raises
    ------
    ConfigError
        The variable is not set, or no file can have this name.
    """
    if name.startswith("$"):
        variable, _, rest = name[1:].partition("/")
        named = os.environ.get(variable)
        if not named:
            raise ConfigError(
                f"the path {name!r} needs the environment variable {variable}; set it to the "
                "folder with the data"
            )
        path = user_path(Path(named) / rest, ConfigError)
    else:
        path = folder / user_path(name, ConfigError)
    return Path(os.path.realpath(path))  # Path.resolve would fail on circular links
