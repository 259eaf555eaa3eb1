"""Tables that are kept as files, so that a long run resumes where it was stopped."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pgm_places.io.atomic import write_text


@dataclass(frozen=True)
class KeptText:
    """Named texts in files of a folder; nothing is kept where there is no folder.

    Parameters
    ----------
    folder : Path or None
        Made if there is none.
    """

    folder: Path | None = None

    def text(self, name: str, make: Callable[[], str]) -> str:
        """The text of that name, made by ``make`` if there is no file of it."""
        if self.folder is None:
            return make()
        path = self.folder / f"{name}.md"
        if not path.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            write_text(path, make())
        return path.read_text(encoding="utf-8")
