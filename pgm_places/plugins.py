"""Registries of classes by name, built-in ones and plug-ins, and optional packages.

A class that configurations can name is a frozen dataclass; its fields are its options. A model
file holds the name and the options, and loading looks the class up by name.
"""

import dataclasses
import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pgm_places.errors import ConfigError, InputError, ModelFileError, OutputError, nearest_name
from pgm_places.options import from_mapping, option_hints
from pgm_places.progress import warn


@dataclasses.dataclass(frozen=True)
class Registry:
    """The named classes of one kind (for messages: ``"method"``), and the entry points of plug-ins.

    ``built_in`` maps names to ``"module:Class"``, imported on first use; an entry point of
    ``group`` is ``name = "package.module:Class"``. ``renamed`` and ``replaced`` are former names
    and values of options in saved models, with their current ones; ``former`` names are accepted
    with a warning until the next release. ``retired`` classes come with a text on what to do
    instead.
    """

    kind: str
    group: str
    built_in: Mapping[str, str] = dataclasses.field(default_factory=dict)
    renamed: Mapping[str, Mapping[str, str]] = dataclasses.field(default_factory=dict)
    replaced: Mapping[tuple[str, str, str], str] = dataclasses.field(default_factory=dict)
    retired: Mapping[str, str] = dataclasses.field(default_factory=dict)
    former: Mapping[str, Mapping[str, str]] = dataclasses.field(default_factory=dict)

    def names(self) -> list[str]:
        """All names, built-in and of plug-ins."""
        return sorted(self._targets())

    def find(self, name: str) -> type[Any]:
        """The class with a name, or at ``"module:Class"``; ConfigError for an unknown name."""
        target = self._target(name) or (name if ":" in name else None)
        if target is None and name in self.retired:
            raise ConfigError(f"there is no {self.kind} {name!r} any more; {self.retired[name]}")
        if target is None:
            known = self.names()
            hint = nearest_name(name, known) if known else f"None is installed ({self.group})"
            raise ConfigError(f"unknown {self.kind} {name!r}. {hint}")
        module_name, _, class_name = target.partition(":")
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as error:
            raise ConfigError(
                f"{self.kind} {name!r} needs {error.name!r}, which is not installed; install it, "
                "or name its folder in PYTHONPATH"
            ) from None
        cls = getattr(module, class_name, None)
        if not (isinstance(cls, type) and dataclasses.is_dataclass(cls)):
            raise ConfigError(
                f"{self.kind} {name!r}: {target} is not a dataclass with its options as fields"
            )
        return cls

    def build(self, name: str, options: Mapping[str, Any] | None = None) -> Any:
        """An instance of the named class with the options.

        ConfigError for an unknown name or option (the nearest is offered), or a value that is
        refused.
        """
        cls = self.find(name)
        known = list(option_hints(cls))
        options = dict(options or {})
        arrays = [field.name for field in dataclasses.fields(cls) if field.metadata.get("given")]
        array_options = {key: options.pop(key) for key in arrays if key in options}
        for old, now in self.former.get(name, {}).items():
            if old in options and now not in options:
                warn(f"{self.kind} {name!r}: {old} is called {now}; the next release refuses {old}")
                options[now] = options.pop(old)
        for key in options:
            if key not in known:
                hint = nearest_name(key, known) if known else "It has none"
                raise ConfigError(f"{self.kind} {name!r} has no option {key!r}. {hint}")
        try:
            built = from_mapping(cls, options)
            return dataclasses.replace(built, **array_options) if array_options else built
        except (TypeError, ValueError) as error:
            raise ConfigError(f"{self.kind} {name!r}: {error}") from None

    def name_of(self, cls: type[Any]) -> str:
        """The registered name of a class; OutputError if it is not registered."""
        own = f"{cls.__module__}:{cls.__qualname__}"
        if own in self.built_in.values():  # entry points need not be read
            return next(name for name, target in self.built_in.items() if target == own)
        targets = self._targets()
        for name, target in targets.items():
            if target == own:
                return name
        for name in targets:  # registered where another module offers it
            if self.find(name) is cls:
                return name
        raise OutputError(
            f"{cls.__qualname__} cannot be saved: it is not registered. Add it to the entry points "
            f"of group {self.group!r} so that it can be found again"
        )

    def from_saved(self, name: str, options: Mapping[str, Any]) -> Any:
        """An instance of a class that a model file names; ModelFileError if it is not installed.

        Only registered classes are allowed: a file must not choose imports. Former names of options
        and values are translated.
        """
        if self._target(name) is None and name in self.retired:
            raise ModelFileError(
                f"there is no {self.kind} {name!r} any more; {self.retired[name]}, and train again"
            )
        if self._target(name) is None:
            raise ModelFileError(
                f"no {self.kind} {name!r} is installed; install the package that adds it to the "
                f"entry points of group {self.group!r}"
            )
        renamed = self.renamed.get(name, {})
        current = {renamed.get(key, key): value for key, value in options.items()}
        for (owner, key, value), now in self.replaced.items():
            if owner == name and current.get(key) == value:
                current[key] = now
        return self.build(name, current)

    def _target(self, name: str) -> str | None:
        """``"module:Class"`` of a name; entry points are read only if it is not built in."""
        return self.built_in.get(name) or self._targets().get(name)

    def _targets(self) -> dict[str, str]:
        from importlib.metadata import entry_points  # the import takes a tenth of a short command

        installed = {point.name: point.value for point in entry_points(group=self.group)}
        return {**installed, **self.built_in}


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
