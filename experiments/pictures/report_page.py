"""Pictures of the page that ``compare`` writes, of a generated building."""

import os
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from experiments.pictures.kept import keep
from tests.studio.browser import launched

FOLDER = Path(__file__).resolve().parents[1] / "reproduced"
"""Kept between runs."""
SIZE = {"width": 1240, "height": 900}


def comparison_page() -> None:
    """The first page of the report on the demo's methods."""
    page = _made(FOLDER / "demo" / "report.html", "demo")
    for theme, shown in _shown(page):
        glance = shown.locator("#glance").bounding_box()
        _keep(f"comparison_{theme}", shown, glance["y"] - 8, glance["y"] + glance["height"] + 16)


def _made(page: Path, *command: str) -> Path:
    """The page, written by a command where it is not there yet."""
    if not page.exists():
        words = (sys.executable, "-m", "pgm_places", *command, "--out", page.parent)
        without = {name: value for name, value in os.environ.items() if name != "PGM_PLACES_DATA"}
        subprocess.run(words, check=True, env=without)
    return page


def _shown(page: Path) -> Any:
    """The page in a browser, in either theme."""
    with launched() as browser:
        for theme in ("light", "dark"):
            shown = browser.new_page(viewport=SIZE, color_scheme=theme)
            shown.goto(page.as_uri())
            yield theme, shown


def _keep(name: str, shown: Any, top: float, bottom: float) -> None:
    clip = {"x": 0, "y": top, "width": SIZE["width"], "height": bottom - top}
    picture = Image.open(BytesIO(shown.screenshot(full_page=True, clip=clip)))
    keep(name, picture.convert("RGB"))
