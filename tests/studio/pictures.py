"""The pictures and the recording of docs/studio.md: ``python -m tests.studio.pictures``."""

import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation import generate_building
from tests.studio.browser import launched, studio
from tests.studio.test_page import at, until

IMAGES = Path(__file__).parents[2] / "docs" / "images"
WIDE = {"width": 1300, "height": 760}
SEED = 11
CELLS = "(metres) => studio.frame.toCells(studio.frame.fromMetres(metres))"


def reduced(picture: Image.Image, n_colours: int) -> Image.Image:
    """A picture with few colours: the most frequent ones as they are, so that shadows stay soft.

    The others keep those of small things, such as doorways.
    """
    pixels = np.asarray(picture, np.int64)
    colours, which, counts = np.unique(
        pixels.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    n_rare = n_colours // 3
    rare = picture.quantize(n_rare, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    others = np.array(rare.getpalette(), np.int64).reshape(-1, 3)[:n_rare]
    palette = np.concatenate([colours[np.argsort(-counts)[: n_colours - n_rare]], others])
    distance = ((colours[:, None] - palette[None]) ** 2).sum(axis=2)
    indices = distance.argmin(axis=1).astype(np.uint8)[which.ravel()].reshape(pixels.shape[:2])
    found = Image.fromarray(indices).convert("P")
    found.putpalette(palette.astype(np.uint8).ravel().tolist())
    return found


class Recording:
    """Frames of a page, each shown for some time."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.frames: list[tuple[Image.Image, int]] = []

    def keep(self, milliseconds: int = 120) -> None:
        picture = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
        self.frames.append((picture.resize((780, 456), Image.Resampling.LANCZOS), milliseconds))

    def save(self, path: Path) -> None:
        pictures = [reduced(picture, 96) for picture, _ in self.frames]
        durations = [milliseconds for _, milliseconds in self.frames]
        pictures[0].save(
            path,
            save_all=True,
            append_images=pictures[1:],
            duration=durations,
            loop=0,
            optimize=True,
        )


def settled(page: Any) -> None:
    """Wait until all is learned and drawn."""
    until(page, "studio.state?.relabelling && !studio.state.learner.working")
    until(page, "studio.state.relabelling.revision >= studio.state.revision - 1")
    page.wait_for_timeout(900)


def record(page: Any, path: Path) -> None:
    """The list, an answer, a stroke, a doorway before it is drawn, the divider, why."""
    film = Recording(page)
    film.keep(1400)
    page.keyboard.press("n")
    page.wait_for_timeout(500)
    film.keep(1400)
    page.keyboard.press("c")
    page.wait_for_timeout(300)
    film.keep(500)
    settled(page)
    film.keep(1000)
    page.keyboard.press("Home")
    page.click("#tab-paint")
    page.keyboard.press("3")
    page.keyboard.press("b")
    region = page.evaluate(
        """studio.places.regions.filter((r) => r.class === 'room')
            .sort((a, b) => b.area_m2 - a.area_m2)[1]"""
    )
    x, y = page.evaluate(CELLS, region["anchor_m"])
    page.keyboard.press("2")
    page.mouse.move(*at(page, x - 25, y - 6))
    page.mouse.down()
    for k in range(8):
        page.mouse.move(*at(page, x - 25 + 7 * k, y - 6 + (8 if k % 2 else 0)))
        film.keep(90)
    page.mouse.up()
    film.keep(500)
    settled(page)
    film.keep(1200)
    page.keyboard.press("d")
    page.mouse.click(*at(page, x - 40, y - 10))
    for k in range(5):
        page.mouse.move(*at(page, x - 40 + 2 * k, y + 8 * k))
        page.wait_for_timeout(250)
        film.keep(160)
    page.keyboard.press("Escape")
    page.keyboard.press("v")
    page.keyboard.press("s")
    for share in (0.5, 0.42, 0.34, 0.42, 0.52, 0.62, 0.7, 0.6, 0.5):
        page.evaluate(f"studio.swipe.move({share})")
        page.wait_for_timeout(150)
        film.keep(110)
    page.keyboard.press("s")
    page.keyboard.press("v")
    page.mouse.click(*at(page, x, y))
    page.wait_for_timeout(600)
    film.keep(2200)
    film.save(path)


def pictures(browser: Any, address: str) -> None:
    """A picture of each panel, in the light and the dark theme by turns, and one of a phone."""

    def visit(theme: str, size: dict[str, int], name: str, act: Callable[[Any], None]) -> None:
        is_phone = size["width"] < 500
        context = browser.new_context(viewport=size, color_scheme=theme, has_touch=is_phone)
        page = context.new_page()
        page.goto(address)
        settled(page)
        act(page)
        page.wait_for_timeout(900)
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        reduced(picture, 255).save(IMAGES / name, optimize=True)
        context.close()

    def layers(page: Any) -> None:
        page.click("#tab-layers")
        page.click("#layer-values")
        page.click("#layer-graph")
        page.click("#layer-names")

    def review(page: Any) -> None:
        page.evaluate("studio.show('review')")
        page.keyboard.press("n")
        page.evaluate("document.activeElement.blur()")

    def why(page: Any) -> None:
        region = page.evaluate("studio.places.regions.find((r) => r.class === 'room')")
        page.mouse.click(*at(page, *page.evaluate(CELLS, region["anchor_m"])))

    def compare(page: Any) -> None:
        page.click("#tab-layers")
        page.keyboard.press("Shift+S")
        page.get_by_label("Second labelling").select_option("unary")

    visit("light", WIDE, "studio_compare.png", compare)
    visit("light", WIDE, "studio.png", lambda page: page.keyboard.press("b"))
    visit("dark", WIDE, "studio_layers.png", layers)
    visit("light", WIDE, "studio_review.png", review)
    visit("light", WIDE, "studio_why.png", why)
    visit("dark", {"width": 390, "height": 780}, "studio_phone.png", review)


def main() -> None:
    """Write all pictures."""
    building = generate_building(SEED)
    with tempfile.TemporaryDirectory() as name, launched() as browser:
        folder = Path(name)
        save_map(building.grid, folder / "office")
        save_labels(folder / "truth.png", building.labels, building.label_names)
        options = ("--labels", folder / "truth.png", "--out", folder / "kept")
        with studio(folder / "office.yaml", *options) as process:
            page = browser.new_page(viewport=WIDE)
            page.goto(process.address)
            settled(page)
            record(page, IMAGES / "studio.gif")
            page.close()
            pictures(browser, process.address)


if __name__ == "__main__":
    main()
