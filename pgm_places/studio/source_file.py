"""A file that the studio has read, watched for changes by others."""

import hashlib
from pathlib import Path


class SourceFile:
    """A file as it was when the studio began.

    Attributes
    ----------
    sha256 : str
        Of its content.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with path.open("rb") as file:
            self.sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        self._seen = self._state()

    def was_changed(self) -> bool:
        """Whether the file is missing, or was written to since."""
        return self._state() != self._seen

    def _state(self) -> tuple[int, int] | None:
        try:
            found = self.path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size
