"""A file that the studio has read, watched for changes by others."""

from pathlib import Path

from pgm_places.io.input_file import sha256_of


class SourceFile:
    """A file as it was when the studio began.

    Attributes
    ----------
    sha256 : str
        Of its content.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.sha256 = path, sha256_of(path)
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
