"""Classes by name: those that ship with the package, and those added through entry points.

What can be named in a configuration is a frozen dataclass: its fields are its options. A model
keeps the name and the options, and finds the class again by the name.
"""

import dataclasses
import importlib
from collections.abc import Mapping
from typing import Any

from pgm_places.errors import ConfigError, ModelFileError, OutputError, nearest_name
from pgm_places.options import from_mapping, option_hints
from pgm_places.progress import warn


@dataclasses.dataclass(frozen=True)
class Registry:
    """The classes of one kind that can be named.

    Parameters
    ----------
    kind : str
        What they are, for messages: ``"method"``.
    group : str
        The entry points by which other packages add theirs: ``name = "package.module:Class"``.
    built_in : mapping of str to str
        Name to ``"module:Class"``, imported only when used.
    renamed : mapping of str to mapping
        Options by the names that models saved by earlier versions use, and their names now.
    replaced : mapping of (str, str, str) to str
        Values that models saved by earlier versions have for a name's option, and those now.
    retired : mapping of str to str
        Names that earlier versions had, and what to do instead.
    former : mapping of str to mapping
        Options by earlier names that are read everywhere for one more release, with a warning.
    """

    kind: str
    group: str
    built_in: Mapping[str, str] = dataclasses.field(default_factory=dict)
    renamed: Mapping[str, Mapping[str, str]] = dataclasses.field(default_factory=dict)
    replaced: Mapping[tuple[str, str, str], str] = dataclasses.field(default_factory=dict)
    retired: Mapping[str, str] = dataclasses.field(default_factory=dict)
    former: Mapping[str, Mapping[str, str]] = dataclasses.field(default_factory=dict)

    def names(self) -> list[str]:
        """All names, built in or installed."""
        return sorted(self._targets())

    def find(self, name: str) -> type[Any]:
        """The class of that name, or behind ``"module:Class"``.

        Raises
        ------
        ConfigError
            There is none; the message offers the nearest name.
        """
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
                f"{self.kind} {name!r} needs {error.name!r}, which is not installed"
            ) from None
        cls = getattr(module, class_name, None)
        if not (isinstance(cls, type) and dataclasses.is_dataclass(cls)):
            raise ConfigError(
                f"{self.kind} {name!r}: {target} is not a dataclass with its options as fields"
            )
        return cls

    def build(self, name: str, options: Mapping[str, Any] | None = None) -> Any:
        """An object of the class of that name with those options.

        Raises
        ------
        ConfigError
            An unknown name or option (the nearest is offered), or a value that is refused.
        """
        cls = self.find(name)
        known = list(option_hints(cls))
        options = dict(options or {})
        arrays = [item.name for item in dataclasses.fields(cls) if item.metadata.get("given")]
        given = {key: options.pop(key) for key in arrays if key in options}
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
            return dataclasses.replace(built, **given) if given else built
        except (TypeError, ValueError) as error:
            raise ConfigError(f"{self.kind} {name!r}: {error}") from None

    def name_of(self, cls: type[Any]) -> str:
        """The name under which a class is found again.

        Raises
        ------
        OutputError
            It is not registered.
        """
        own = f"{cls.__module__}:{cls.__qualname__}"
        if own in self.built_in.values():  # no other package need be asked
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

    def restored(self, name: str, options: Mapping[str, Any]) -> Any:
        """What a model file names: only registered classes, a file must not choose imports.

        Options and values that have other names since then are found under these.

        Raises
        ------
        ModelFileError
            No class of that name is installed.
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
        given = {renamed.get(key, key): value for key, value in options.items()}
        for (owner, key, value), now in self.replaced.items():
            if owner == name and given.get(key) == value:
                given[key] = now
        return self.build(name, given)

    def _target(self, name: str) -> str | None:
        """Where the class of that name is; entry points are read only for names not built in."""
        return self.built_in.get(name) or self._targets().get(name)

    def _targets(self) -> dict[str, str]:
        from importlib.metadata import entry_points  # it takes a tenth of a short command to import

        installed = {point.name: point.value for point in entry_points(group=self.group)}
        return {**installed, **self.built_in}
