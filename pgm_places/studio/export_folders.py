"""Export folders: where the exports of a studio may be written.

The page names a folder, so a page that got hold of the address could, too. It may name what its
user has named on the command line or what lies below the folder that the studio was started in,
nothing hidden, and no export takes the place of a file that the studio was given.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from pgm_places.errors import InputError

LONGEST = 1000
"""Characters of a path from the page."""

MOST_OFFERED = 60
"""Folders that are offered by name; any other can be typed."""


@dataclass(frozen=True)
class ExportFolders:
    """Where the exports of a studio may go.

    Parameters
    ----------
    working : Path
        The folder that the studio was started in; names are told from there.
    told : sequence of Path
        Further folders, from the command line.
    given : frozenset of Path
        Files and folders that the studio reads: nothing is written there.
    """

    working: Path
    told: tuple[Path, ...] = ()
    given: frozenset[Path] = frozenset()

    @classmethod
    def started_here(cls, told: Sequence[Path] = (), given: Iterable[Path] = ()) -> Self:
        """Those of a studio that is started in the current folder."""
        return cls(
            Path.cwd().resolve(),
            tuple(path.resolve() for path in told),
            frozenset(path.resolve() for path in given),
        )

    def chosen(self, text: str, own: Path) -> Path:
        """The folder of that name, which need not be there yet; the session's ``own`` for none.

        Raises
        ------
        InputError
            The page may not have files written there.
        """
        if not text.strip():
            return own
        if len(text) > LONGEST or not text.isprintable():
            raise InputError("the name of a folder is too long, or has characters that none has")
        if text.startswith("~"):
            raise InputError(f"write {text!r} out: '~' is not understood here")
        try:
            folder = (self.working / text).resolve()  # links are followed before it is judged
            in_circles = any(path.is_symlink() for path in (folder, *folder.parents))
        except (OSError, RuntimeError, ValueError):
            in_circles = True  # Python before 3.13 raises, later ones leave the link as it is
        if in_circles:
            raise InputError(f"{text!r} cannot be a folder")
        if folder == own.resolve():
            return own
        root = next((root for root in self.roots(own) if folder.is_relative_to(root)), None)
        if root is None:
            raise InputError(
                f"exports go below {self.working} or into a folder given with --export-to; "
                f"{folder} is neither"
            )
        if any(part.startswith(".") for part in folder.relative_to(root).parts):
            raise InputError(f"{text!r} is hidden; choose a folder without a dot before its name")
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{text!r} is a file; name a folder")
        return folder

    def roots(self, own: Path) -> tuple[Path, ...]:
        """The folders below which files may be written; never all of the disk."""
        found = (own.resolve(), *self.told, self.working)
        return tuple(root for root in found if root.parent != root or root in self.told)

    def check_free(self, targets: Iterable[Path], further: Iterable[Path] = ()) -> None:
        """Raise InputError where one of the targets is what the studio was given, or holds it."""
        given = {*self.given, *(path.resolve() for path in further)}
        for target in targets:
            whole = target.resolve()
            if any(item == whole or item.is_relative_to(whole) for item in given):
                raise InputError(
                    f"{target} is what the studio was started with; choose another folder"
                )

    def offered(self, own: Path) -> list[str]:
        """Names of folders to choose from: the session's own, those told, and those at hand."""
        found = [self.name_of(own), *map(self.name_of, self.told)]
        try:
            inside = sorted(path for path in self.working.iterdir() if path.is_dir())
        except OSError:
            inside = []
        found += [path.name for path in inside if not path.name.startswith(".")]
        return list(dict.fromkeys(found))[:MOST_OFFERED]

    def name_of(self, folder: Path) -> str:
        """A folder as its user would call it: from the working folder where it lies below it."""
        whole = folder.resolve()
        below = whole.is_relative_to(self.working) and whole != self.working
        return str(whole.relative_to(self.working) if below else whole)
