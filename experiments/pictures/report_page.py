"""The picture of the page that ``pgm-places reproduce`` writes, on generated buildings."""

import os
import subprocess
import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

from experiments.pictures.kept import keep
from tests.studio.browser import launched

FOLDER = Path(__file__).resolve().parents[1] / "reproduced" / "generated"
"""Kept between runs; the section takes half an hour."""
SECTION = "7.5"
SIZE = {"width": 1240, "height": 900}


def report_page() -> None:
    """The beginning of the section, for light pages and for dark ones."""
    page = FOLDER / "reproduce.html"
    if not page.exists():
        command = (sys.executable, "-m", "pgm_places", "reproduce", SECTION, "--out", FOLDER)
        without = {name: value for name, value in os.environ.items() if name != "PGM_PLACES_DATA"}
        subprocess.run(command, check=True, env=without)
    with launched() as browser:
        for theme in ("light", "dark"):
            shown = browser.new_page(viewport=SIZE, color_scheme=theme)
            shown.goto(page.as_uri())
            top = shown.locator("h2", has_text=SECTION).bounding_box()["y"] - 20
            figure = shown.locator("figure, img").first.bounding_box()
            clip = {
                "x": 0,
                "y": top,
                "width": SIZE["width"],
                "height": figure["y"] + figure["height"] + 26 - top,
            }
            picture = Image.open(BytesIO(shown.screenshot(full_page=True, clip=clip)))
            keep(f"reproduce_{theme}", picture.convert("RGB"))
