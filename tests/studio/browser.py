"""A browser for tests, where there is one, and studios as processes of their own."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

REQUIRED = "PGM_PLACES_BROWSER"
"""Set to ``required`` where a missing browser is a failure rather than a reason to skip."""

NAMES = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str:
    """The path of Chromium; skips the running test, or fails it, where there is none."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        words = "no Chromium found (Debian: apt-get install chromium)"
        if os.environ.get(REQUIRED) == "required":
            pytest.fail(words)
        pytest.skip(words)
    return found


@contextlib.contextmanager
def launched() -> Iterator[Any]:
    """A browser of playwright's."""
    path = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


class StudioProcess:
    """``pgm-places studio`` as a process, and its address."""

    def __init__(self, *arguments: object) -> None:
        words = [sys.executable, "-m", "pgm_places", "studio", *map(str, arguments)]
        self.process = subprocess.Popen(
            [*words, "--no-browser", "--quiet"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", self.address), self.address

    def kill(self) -> None:
        """End it as a power cut would."""
        self._end(signal.SIGKILL)

    def stop(self) -> int:
        """End it as Ctrl-C does; its exit code."""
        return self._end(signal.SIGINT)

    def _end(self, number: signal.Signals) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
            _, self.complaints = self.process.communicate(timeout=60)
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()
        return int(self.process.returncode)


@contextlib.contextmanager
def studio(map_yaml: Path, *arguments: object) -> Iterator[StudioProcess]:
    """A studio that is killed at the end, if it still runs."""
    process = StudioProcess(map_yaml, *arguments)
    try:
        yield process
    finally:
        process.kill()
