"""The page in a real browser: what a person does, and what is then on the disk."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.session import MapSession
from tests.studio.browser import StudioProcess, launched, studio

SIZE = {"width": 1200, "height": 800}
PATIENCE_S = 120.0
Open = Callable[[StudioProcess], Any]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as found:
        yield found


@pytest.fixture
def opened(browser: Any) -> Iterator[Open]:
    """Opens pages, and fails if one of them had a complaint."""
    context = browser.new_context(viewport=SIZE)
    context.set_default_timeout(1000 * PATIENCE_S)
    complaints: list[str] = []

    def visit(process: StudioProcess) -> Any:
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda message: complaints.append(message.text) if message.type == "error" else None,
        )
        page.goto(process.address)
        until(page, "window.studio?.state")
        return page

    yield visit
    context.close()
    ours = ("400 (Bad Request)", "403 (Forbidden)", "net::ERR_")  # refused, or killed by us
    unexpected = [text for text in complaints if not any(part in text for part in ours)]
    assert not unexpected


@pytest.fixture
def running(map_yaml: Path) -> Iterator[StudioProcess]:
    """A studio without a model."""
    folders = ("--out", map_yaml.parent / "kept", "--export-to", map_yaml.parent / "told")
    with studio(map_yaml, "--model", "none", *folders) as process:
        yield process


def until(page: Any, condition: str) -> None:
    """Wait for a condition; playwright's own way to wait would need a weaker content policy."""
    deadline = time.monotonic() + PATIENCE_S
    while not page.evaluate(condition):
        assert time.monotonic() < deadline, condition
        page.wait_for_timeout(30)


def at(page: Any, x: float, y: float) -> tuple[float, float]:
    """The point of the screen at a point of the map: cells from the lower left corner."""
    point = page.evaluate(
        """([x, y]) => {
            const box = studio.view.canvas.getBoundingClientRect();
            const at = studio.view.toScreen(x, studio.state.map.rows - y);
            return [at.x + box.left, at.y + box.top];
        }""",
        [x, y],
    )
    return point[0], point[1]


def click(page: Any, x: float, y: float) -> None:
    page.mouse.click(*at(page, x, y))


def drag(page: Any, *points: tuple[float, float]) -> None:
    page.mouse.move(*at(page, *points[0]))
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*at(page, *point), steps=4)
    page.mouse.up()


def keys(page: Any, *pressed: str) -> None:
    for key in pressed:
        page.keyboard.press(key)


def rectangles(page: Any, *painted: tuple[str, tuple[float, float], tuple[float, float]]) -> None:
    """Paint each from corner to corner in the class of a key."""
    for key, first, last in painted:
        keys(page, key, "r")
        drag(page, first, last)


def wait_revision(page: Any, revision: int) -> None:
    until(page, f"studio.state.revision === {revision}")


def wait_taught(page: Any, revision: int) -> None:
    labelled = f"studio.state.relabelling?.revision >= {revision}"
    until(page, f"{labelled} && !studio.state.learner.working")


def painted(map_yaml: Path) -> Any:
    """The paint as a new process would read it, after the studio has ended."""
    session = MapSession(load_map(map_yaml), map_yaml.parent / "kept", None)
    session.close()
    return session.painting


def test_paint_undo_and_redo_by_keys(opened: Open, running: StudioProcess, map_yaml: Path) -> None:
    page = opened(running)
    page.keyboard.press("2")  # a class: the brush is at hand
    held: list[Any] = []
    page.route("**/edit", lambda route: held.append(route))
    drag(page, (8, 8), (18, 12))
    until(page, "document.getElementById('status').textContent === 'Painting'")
    held.pop().continue_()
    page.unroute("**/edit")
    wait_revision(page, 1)
    until(page, "document.getElementById('status').textContent !== 'Painting'")
    page.keyboard.press("r")
    drag(page, (30, 8), (40, 18))
    wait_revision(page, 2)
    page.keyboard.press("Control+z")
    wait_revision(page, 3)
    assert page.locator("#act-redo").is_enabled()
    page.keyboard.press("Control+Shift+z")
    wait_revision(page, 4)
    keys(page, "0", "r")
    drag(page, (34, 12), (36, 14))
    wait_revision(page, 5)
    assert running.stop() == 130
    assert running.complaints == "pgm-places: interrupted; no file is left half-written\n"
    labels = painted(map_yaml).labels
    assert labels[8, 8] == 1 and labels[9, 31] == 1
    assert (labels[12:14, 34:36] == -1).all()


def test_learn_from_the_paint_then_fill_rename_and_export(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    rectangles(page, ("1", (6, 6), (24, 24)))
    keys(page, "2", "p")
    for point in ((27, 6), (45, 6), (45, 24), (27, 24)):
        click(page, *point)
    page.keyboard.press("Enter")
    wait_taught(page, 2)
    page.keyboard.press("v")
    click(page, 10.5, 10.5)
    page.wait_for_selector("#panel-why .note")
    assert "You painted it corridor" in page.inner_text("#panel-why .note")
    page.fill("#panel-why input.field", "hall of fame")
    page.keyboard.press("Enter")
    wait_revision(page, 3)
    until(page, "studio.places.regions.some((r) => r.name === 'hall of fame')")
    until(page, "document.getElementById('readout').textContent.includes('hall of fame')")
    keys(page, "f", "3")
    click(page, 10.5, 10.5)
    wait_taught(page, 4)
    page.keyboard.press("Control+z")
    wait_taught(page, 5)
    page.click("#tab-paint")
    page.get_by_role("button", name="Export").click()
    page.get_by_label("Training configuration").check()
    page.get_by_role("button", name="Write").click()
    told = "document.querySelector('#export [role=status]').textContent"
    until(page, f"{told}.includes('train.toml')")
    assert page.locator("#export .state", has_text="not written yet").count() == 2
    page.get_by_label("Folder").fill("..")
    page.keyboard.press("Enter")
    until(page, f"{told}.includes('exports go below')")
    assert page.get_by_role("button", name="Write").is_disabled()
    page.get_by_label("Folder").fill(str(map_yaml.parent / "told" / "floor"))
    page.keyboard.press("Enter")
    until(page, f"{told} === ''")
    page.get_by_label("Training configuration").uncheck()
    page.get_by_role("button", name="Write").click()
    until(page, f"{told}.includes('labels.png')")
    assert (map_yaml.parent / "told" / "floor" / "labels.png").exists()
    assert page.locator("#export .state", has_text="replaces labels.png").count() == 1
    page.get_by_role("button", name="Close").click()
    kept = map_yaml.parent / "kept"
    names = [item["name"] for item in json.loads((kept / "places.json").read_text())["regions"]]
    assert "hall of fame" in names
    assert "hall of fame" in (kept / "place_names.yaml").read_text()
    assert (kept / "train.toml").exists()


def test_a_region_is_split_by_a_doorway_and_merged_with_another(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    rectangles(page, ("1", (6, 6), (24, 24)), ("2", (27, 6), (45, 24)))
    wait_taught(page, 2)
    page.keyboard.press("v")
    click(page, 10.5, 10.5)
    page.click("text=Split by a doorway")
    click(page, 25.5, 14.3)
    click(page, 25.5, 15.7)
    wait_taught(page, 3)
    until(page, "studio.places.regions.some((region) => region.class === 'doorway')")
    page.keyboard.press("v")
    click(page, 10.5, 10.5)
    page.click("text=Merge with another")
    click(page, 40.5, 10.5)
    wait_revision(page, 4)
    running.stop()
    labels = painted(map_yaml).labels
    assert np.unique(labels[labels >= 0]).size == 1
    assert labels[15, 25] >= 0


def test_a_place_that_could_be_two_rooms_is_split_by_a_key(
    opened: Open, running: StudioProcess
) -> None:
    page = opened(running)
    # A corner keeps the other class alive.
    rectangles(page, ("2", (5, 5), (46, 25)), ("1", (5, 5), (8, 8)))
    wait_taught(page, 2)
    large = "(region) => region.area_m2 > 20"
    until(page, f"studio.places.regions.some({large})")
    page.evaluate(f"studio.goTo(studio.places.regions.find({large}).id)")
    until(page, "document.body.textContent.includes('Split into 2')")
    page.keyboard.press("a")
    wait_taught(page, 3)
    until(page, "studio.places.regions.some((region) => region.class === 'doorway')")


PIXEL = """([x, y, pane]) => {
    const { view, stage } = studio;
    const at = view.toScreen(x, studio.state.map.rows - y);
    const corner = view.corners[pane];
    const [right, down] = [(at.x + corner.x) * view.ratio, (at.y + corner.y) * view.ratio];
    return [...stage.context.getImageData(right, down, 1, 1).data].slice(0, 3);
}"""


def colours_of_panes(page: Any, x: float, y: float) -> list[tuple[int, ...]]:
    """What each pane shows of a cell, without outlines and names, once all tiles are there."""
    page.evaluate("for (const name of ['regions', 'names']) studio.layers.set(name, 0)")
    until(page, "[...studio.stage.tiles.values()].every((layer) => layer.settled)")
    page.wait_for_timeout(200)
    panes = page.evaluate("studio.view.panes")
    return [tuple(page.evaluate(PIXEL, [x, y, k])) for k in range(panes)]


def test_the_next_place_is_the_one_that_has_moved_up_and_what_is_read_of_a_cell_its_own(
    opened: Open, running: StudioProcess
) -> None:
    page = opened(running)
    for y in (6, 18):
        rectangles(page, ("2", (6, y), (14, y + 6)), ("1", (27, y), (35, y + 6)))
    wait_taught(page, 4)
    until(page, "studio.placesVersion === `${studio.state.relabelling.number}.4`")
    ids = page.evaluate("studio.places.checks.map((check) => check.id)")
    assert len(ids) >= 3
    page.click("#tab-review")
    page.keyboard.press("n")
    assert page.evaluate("studio.chosen") == ids[0]
    # As a correction of the first place would leave the list; which it does depends on the rest.
    page.evaluate("studio.places.checks.unshift(...studio.places.checks.splice(1, 1))")
    page.evaluate("studio.changed()")
    page.keyboard.press("n")
    assert page.evaluate("studio.chosen") == ids[1]
    page.keyboard.press("n")
    assert page.evaluate("studio.chosen") == ids[0]
    held: list[Any] = []
    page.route("**/cell?*", lambda route: held.append(route))
    page.mouse.move(*at(page, 10.5, 10.5))
    deadline = time.monotonic() + PATIENCE_S
    while not held:
        assert time.monotonic() < deadline
        page.wait_for_timeout(20)
    page.mouse.move(5, 5)  # off the map
    held.pop().continue_()
    page.wait_for_timeout(300)
    assert page.inner_text("#readout") == ""
    page.unroute("**/cell?*")
    page.mouse.move(*at(page, 10.5, 10.5))
    until(page, "document.getElementById('readout').textContent.includes(' m')")
    before = page.inner_text("#readout")
    page.keyboard.press("+")  # another cell is under the pointer now
    until(page, f"document.getElementById('readout').textContent !== {before!r}")


def press(page: Any, key: str, code: str, **modifiers: bool) -> None:
    """A key as a keyboard of another country sends it: what it types, and where it lies."""
    page.evaluate(
        """([key, code, modifiers]) => document.getElementById('canvas').dispatchEvent(
            new KeyboardEvent(
                'keydown', { key, code, bubbles: true, cancelable: true, ...modifiers }))""",
        [key, code, modifiers],
    )


def test_two_files_are_compared_side_by_side_and_painted_in_either_pane(
    opened: Open, map_yaml: Path
) -> None:
    grid = load_map(map_yaml).grid
    for label, name in enumerate(("one", "other")):
        labels = np.where(grid.free, label, -1)
        labels[:, 26:] = np.where(grid.free[:, 26:], 1, -1)
        save_labels(map_yaml.parent / f"{name}.png", labels, ["corridor", "room"])
    files = [str(map_yaml.parent / f"{name}.png") for name in ("one", "other")]
    options = ("--model", "none", "--out", map_yaml.parent / "kept")
    with studio(map_yaml, "--labels", files[0], "--labels", files[1], *options) as process:
        page = opened(process)
        page.keyboard.press("Shift+S")
        assert page.get_attribute("#act-side", "aria-pressed") == "true"
        page.click("#tab-layers")
        page.get_by_label("First labelling").select_option("one.png")
        page.get_by_label("Second labelling").select_option("other.png")
        assert page.inner_text("#left-title") == "one.png"
        assert page.inner_text("#right-title") == "other.png"
        left, right = colours_of_panes(page, 10, 10)
        assert left != right
        left, right = colours_of_panes(page, 40, 10)
        assert left == right

        page.keyboard.press("r")
        x, y = at(page, 30, 8)
        pane = page.evaluate("studio.view.width")
        page.mouse.move(x + pane, y)
        page.mouse.down()
        x, y = at(page, 40, 14)
        page.mouse.move(x + pane, y, steps=4)
        page.mouse.up()
        wait_revision(page, 1)
        left, right = colours_of_panes(page, 35, 11)
        assert left == right != colours_of_panes(page, 44, 20)[0]
        page.keyboard.press("s")
        assert page.evaluate("[studio.swipe.way, studio.view.panes]") == ["divider", 1]
        assert page.inner_text("#right-side") == "other.png"
        page.keyboard.press("s")
        assert page.evaluate("studio.swipe.way") == "one"
    labels = painted(map_yaml).labels
    assert (labels[9:13, 31:39] == 0).all() and (labels[:, :26] == -1).all()


def test_labels_open_the_list_of_what_is_in_doubt_and_one_press_answers(
    opened: Open, map_yaml: Path
) -> None:
    grid = load_map(map_yaml).grid
    truth = np.where(grid.free, 1, -1)
    save_labels(map_yaml.parent / "truth.png", truth, ["corridor", "room", "doorway"])
    options = ("--model", "generated", "--out", map_yaml.parent / "kept")
    with studio(map_yaml, "--labels", map_yaml.parent / "truth.png", *options) as process:
        page = opened(process)
        idle = "studio.state.relabelling && !studio.state.learner.working"
        until(page, f"{idle} && studio.placesVersion")
        assert page.evaluate("studio.tab") == "review"
        until(page, "document.getElementById('status').textContent === 'Up to date'")
        assert page.inner_text("#agrees").endswith(" % agree")
        page.keyboard.press("n")
        chosen = page.evaluate("studio.chosen")
        assert page.locator(".checks .chosen .answers").count() == 1
        page.get_by_role("button", name="Yes,").click()
        wait_revision(page, 1)
        wait_taught(page, 1)
        confirmed = page.evaluate(f"studio.places.byId.get({chosen}).class")
        assert page.evaluate("studio.state.painted") > 0
        page.evaluate(f"studio.goTo({chosen})")
        other = "corridor" if confirmed == "room" else "room"
        page.locator(".answers .chip", has_text=other).click()
        wait_taught(page, 2)
        until(page, f"studio.places.regions.some((r) => r.class === {other!r})")
        page.click("#tab-paint")
        assert not page.evaluate("studio.state.learns")
        page.get_by_role("button", name="Teach from this").click()
        until(page, "studio.state.learns")
        page.get_by_role("button", name="Stop teaching").wait_for()
        page.click("#tab-layers")
        page.get_by_label("Compare", exact=True).select_option("Side by side")
        page.get_by_label("Second labelling").select_option("Method relaxation")
        colours_of_panes(page, 10, 10)
        kept = page.evaluate("[...studio.stage.layer('labels-method:relaxation').cache.values()]")
        assert kept and all(entry["image"] is not None for entry in kept)


SAYS_THAT_MUCH_CHANGED = """() => {
    const get = studio.server.get.bind(studio.server);
    studio.server.get = async (path, ...more) => {
        const found = await get(path, ...more);
        const relabelling = path === "state" && found.relabelling;
        if (relabelling) relabelling.changed = "25.0 m² became room";
        return found;
    };
}"""
"""Whether anything changes elsewhere on so small a map depends on what is learned."""


def test_several_maps_are_listed_and_each_leads_back(
    opened: Open, browser: Any, map_yaml: Path
) -> None:
    save_map(load_map(map_yaml).grid, map_yaml.parent / "other")
    options = (map_yaml.parent / "other.yaml", "--model", "none", "--out", map_yaml.parent / "all")
    with studio(map_yaml, *options) as process:
        page = browser.new_page(viewport=SIZE)
        page.goto(process.address)
        page.get_by_role("link", name="other").click()
        until(page, "window.studio?.state")
        assert page.inner_text("#map-name") == "other"
        rectangles(page, ("1", (6, 6), (14, 12)))
        wait_revision(page, 1)
        page.click("#all-maps")
        page.wait_for_selector("text=m² painted")
        assert page.inner_text("#status") == "1 of 2 painted"
        page.get_by_role("button", name="Write the training").click()
        page.wait_for_selector("#toast.bad")  # one class alone teaches nothing
        assert "two classes" in page.inner_text("#toast")
        page.close()


def test_every_tool_draws_from_the_keyboard(opened: Open, running: StudioProcess) -> None:
    page = opened(running)
    keys(page, "1", "r")
    page.focus("#canvas")
    for _ in range(2):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    for key in ("ArrowLeft", "ArrowUp") * 4:
        page.keyboard.press(key)
    page.keyboard.press("Enter")
    wait_revision(page, 1)
    before = page.evaluate("studio.state.painted")
    keys(page, "2", "b", "Enter")
    for _ in range(6):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    wait_revision(page, 2)
    assert page.evaluate("studio.state.painted") > before
    keys(page, "3", "p")
    for key in ("ArrowDown", "ArrowLeft", "ArrowUp"):
        page.keyboard.press("Enter")
        for _ in range(4):
            page.keyboard.press(key)
    assert page.evaluate("studio.tools.points.length") == 3
    page.keyboard.press("Shift+Enter")
    wait_revision(page, 3)
    keys(page, "d", "Enter", "ArrowDown", "Enter")
    wait_revision(page, 4)
    x = page.evaluate("studio.view.x")
    page.keyboard.press("Shift+ArrowLeft")
    assert page.evaluate("studio.view.x") == x + 80


def test_only_one_class_is_painted_over(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    rectangles(page, ("1", (6, 6), (14, 12)), ("2", (14, 6), (24, 12)))
    wait_revision(page, 2)
    page.keyboard.press("3")
    page.get_by_label("What is painted over").select_option("only over room")
    drag(page, (6, 6), (24, 9))
    wait_revision(page, 3)
    page.keyboard.press("f")
    page.wait_for_selector("#options[hidden]", state="attached")
    running.stop()
    labels = painted(map_yaml).labels
    assert (labels[7, 7:13] == 0).all() and (labels[7, 15:23] == 2).all()


def test_tool_layers_and_comparison_survive_a_reload(opened: Open, running: StudioProcess) -> None:
    page = opened(running)
    keys(page, "2", "p")
    page.click("#tab-layers")
    page.get_by_label("Gates", exact=True).check()
    page.keyboard.press("Shift+S")
    page.evaluate("studio.changed()")
    page.reload()
    until(page, "window.studio?.state")
    seen = page.evaluate(
        "[studio.tools.name, studio.label, studio.layers.shown.gates, studio.swipe.way]"
    )
    assert seen == ["polygon", 1, 1, "side"]


def test_nothing_is_lost_by_a_reload_or_a_kill(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    page.fill("input[placeholder^='Another class']", "lab")
    page.keyboard.press("Enter")
    until(page, "studio.state.classes.length === 4 && studio.label === 3")
    drag(page, (8, 8), (18, 12))
    wait_revision(page, 2)
    page.reload()
    until(page, "window.studio?.state?.revision === 2")
    assert page.get_by_role("button", name="lab", exact=True).is_visible()
    running.kill()
    page.wait_for_selector("#status.failed")
    with studio(map_yaml, "--model", "none", "--out", map_yaml.parent / "kept") as again:
        page = opened(again)
        assert page.evaluate("studio.state.classes.map((item) => item.name)")[3] == "lab"
        page.keyboard.press("Control+z")
        wait_revision(page, 3)
        assert page.evaluate("studio.state.painted") == 0
    page.wait_for_selector("#status.failed")
    page.keyboard.press("r")
    drag(page, (8, 8), (18, 12))
    page.wait_for_selector("#toast.bad")
    assert "Not saved: the studio is not running" in page.inner_text("#toast")
    assert page.evaluate("studio.changed(), document.getElementById('status').className") == (
        "status failed"
    )
    assert page.inner_text("#status") == "The studio has stopped; 1 later edit was not saved"
    assert "this tab cannot know where" in page.inner_text("#notices")
    assert (painted(map_yaml).labels == -1).all()
    with studio(map_yaml, "--model", "none", "--out", map_yaml.parent / "kept") as again:
        page.wait_for_selector("#notices >> text=cannot know its address")
        opened(again)
        page.click("text=Go on in the new one.")
        until(page, "window.studio?.state")
        assert page.url == again.address


def test_a_large_map_is_moved_and_zoomed_by_keys_and_wheel(browser: Any, tmp_path: Path) -> None:
    cells = np.zeros((3000, 4000), np.int8)
    cells[::100] = cells[:, ::125] = 100
    cells[50::100] = cells[:, 60::125] = 0
    save_map(OccupancyGrid(cells, 0.05), tmp_path / "large")
    with studio(tmp_path / "large.yaml", "--model", "none", "--out", tmp_path / "kept") as process:
        page = browser.new_page(viewport=SIZE)
        page.goto(process.address)
        until(page, "window.studio?.stage.tiles.get('map')?.settled")
        before = page.evaluate("studio.view.scale")
        page.mouse.move(600, 400)
        for _ in range(6):
            page.mouse.wheel(0, -300)
        until(page, f"studio.view.scale > {4 * before}")
        page.focus("#canvas")
        here = page.evaluate("studio.view.x")
        page.keyboard.press("ArrowLeft")
        assert page.evaluate("studio.view.x") == here + 80
        until(page, "studio.stage.tiles.get('map').settled")
        kept = page.evaluate("[...studio.stage.tiles.get('map').cache.keys()]")
        assert 0 < len(kept) < 100  # of 192 at the lowest level alone
        page.keyboard.press("Home")
        assert page.evaluate("studio.view.scale") == pytest.approx(before)
        page.close()


def test_a_place_is_cut_by_two_clicks_and_undone(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    rectangles(page, ("1", (5, 5), (25, 25)), ("2", (26, 5), (46, 25)))
    wait_taught(page, 2)
    until(page, "studio.places.regions.length === 2")
    page.keyboard.press("k")
    assert page.locator("#hint").text_content().startswith("Click on either side")
    click(page, 15.5, 8.5)
    page.mouse.move(*at(page, 15.5, 20.5))
    until(page, "studio.tools.line")
    ends = page.evaluate("studio.tools.line.map((end) => studio.frame.toCells(end)[1])")
    assert sorted(ends) == pytest.approx([5.5, 24.5], abs=0.6)  # from wall to wall
    click(page, 15.5, 20.5)
    wait_taught(page, 3)
    until(page, "studio.places.regions.length === 3")
    assert page.evaluate("studio.places.regions.every((region) => region.class !== 'doorway')")
    click(page, 25.5, 13.3)  # the door, whose sides are two classes already
    click(page, 25.5, 16.7)
    until(page, "document.getElementById('toast').textContent.includes('divides nothing')")
    page.keyboard.press("Control+z")
    wait_taught(page, 4)
    until(page, "studio.places.regions.length === 2")
    running.stop()
    assert painted(map_yaml).cuts == ()


def test_a_doorway_is_shown_in_its_colour_where_it_will_end_and_painted_by_two_clicks(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    page.keyboard.press("d")
    click(page, 10.5, 10.5)
    page.mouse.move(*at(page, 10.5, 20.5))
    seen = []
    for digit in "12":
        page.keyboard.press(digit)
        seen += colours_of_panes(page, 10.5, 15.5)
    assert seen[0] == seen[1] != colours_of_panes(page, 16.5, 15.5)[0]
    keys(page, "Escape", "d")
    click(page, 25.5, 14.3)
    page.mouse.move(*at(page, 25.5, 15.7))
    until(page, "studio.tools.line")
    ends = page.evaluate("studio.tools.line.map((end) => studio.frame.toCells(end)[1])")
    assert sorted(ends) == pytest.approx([13.5, 16.5], abs=0.6)
    page.keyboard.press("Escape")
    assert page.evaluate("studio.tools.line") is None
    click(page, 10.5, 9)
    click(page, 10.5, 12)
    page.wait_for_selector("#toast.bad")
    assert "parts nothing" in page.inner_text("#toast")
    click(page, 25.5, 14.3)
    click(page, 25.5, 15.7)
    wait_revision(page, 1)
    running.stop()
    assert (painted(map_yaml).labels[13:17, 25] == 2).all()


def test_a_class_is_changed_in_place_and_a_second_tab_and_a_changed_map_are_noticed(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    before = page.evaluate("studio.state.classes[1].colour")
    swatch = page.get_by_label("Colour of room")
    swatch.focus()
    swatch.fill("#aa2244")
    wait_revision(page, 1)
    assert page.evaluate("studio.state.classes[1].colour") == "#aa2244"
    page.keyboard.press("Control+z")
    wait_revision(page, 2)
    assert page.evaluate("studio.state.classes[1].colour") == before
    until(page, f"document.querySelector('[aria-label=\"Colour of room\"]').value === '{before}'")
    page.get_by_role("button", name="Rename doorway").click()
    page.get_by_label("New name of doorway").fill("gate")
    page.keyboard.press("Enter")
    until(page, "studio.state.classes[2].name === 'gate'")
    page.get_by_role("button", name="Rename gate").click()
    page.get_by_label("New name of gate").fill("other")
    page.keyboard.press("Escape")
    page.get_by_role("button", name="gate", exact=True).wait_for()
    assert page.evaluate("studio.state.revision") == 3
    page.get_by_role("button", name="Delete gate").click()
    until(page, "studio.state.classes.length === 2")
    assert page.get_by_role("button", name="Delete room").count() == 0  # two must be left
    first, second = page, opened(running)
    first.wait_for_selector("text=open in 2 tabs")
    first.keyboard.press("1")
    drag(first, (8, 8), (18, 12))
    wait_revision(second, 5)
    second.close()
    first.wait_for_selector("text=open in 2 tabs", state="detached")
    map_yaml.write_text(map_yaml.read_text() + "\n")
    drag(first, (8, 8), (10, 8))
    first.wait_for_selector("text=was changed on the disk")


def test_two_panes_keep_their_middle_and_are_stacked_on_a_phone(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    page.keyboard.press("Shift+S")
    until(page, "studio.view.panes === 2")
    middle = "Object.values(studio.view.toMap(studio.view.width / 2, studio.view.height / 2))"
    before = page.evaluate(middle)
    page.set_viewport_size({"width": 1000, "height": 640})
    canvas = "document.getElementById('stage').querySelector('canvas')"
    until(page, f"innerWidth === 1000 && {canvas}.width === {canvas}.clientWidth")
    assert page.evaluate(middle) == pytest.approx(before, abs=0.01)
    page.set_viewport_size({"width": 390, "height": 780})
    until(page, "document.getElementById('stage').dataset.panes === 'stacked'")
    shows_metres = "document.getElementById('readout').textContent.includes(' m')"
    deadline = time.monotonic() + PATIENCE_S
    while not page.evaluate(shows_metres):  # the panes may still be moving under the mouse
        assert time.monotonic() < deadline
        page.mouse.move(*at(page, 10, 10))
        page.mouse.move(*at(page, 11, 10))
        page.wait_for_timeout(30)
    title, readout = (
        page.locator(f"#{name}").bounding_box() for name in ("right-title", "readout")
    )
    assert title["y"] + title["height"] <= readout["y"]


def test_keys_of_other_keyboards_are_understood_and_a_corner_is_taken_back(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    page.keyboard.press("1")
    drag(page, (8, 8), (18, 12))
    wait_revision(page, 1)
    press(page, "z", "KeyY", ctrlKey=True)  # QWERTZ
    wait_revision(page, 2)
    assert page.evaluate("studio.state.painted") == 0
    press(page, "y", "KeyZ", ctrlKey=True)
    wait_revision(page, 3)
    press(page, "z", "KeyW", ctrlKey=True)  # AZERTY
    wait_revision(page, 4)
    assert page.evaluate("studio.state.painted") == 0
    press(page, "Я", "KeyZ", ctrlKey=True, shiftKey=True)  # letters that are not Latin
    wait_revision(page, 5)
    assert page.evaluate("studio.state.painted") > 0
    before = page.evaluate("studio.tools.radius")
    press(page, "]", "Digit9", ctrlKey=True, altKey=True, modifierAltGraph=True)  # AltGr 9
    assert page.evaluate("studio.tools.radius") == pytest.approx(1.25 * before)
    press(page, "[", "Digit8", altKey=True)  # Option 8
    assert page.evaluate("studio.tools.radius") == pytest.approx(before)
    assert page.evaluate("studio.label") == 0  # neither has chosen a class
    page.keyboard.press("p")
    for x in (28, 38, 39, 40):
        click(page, x, 10)
    keys(page, "Backspace", "Control+z")
    assert page.evaluate("studio.tools.points.length") == 2
    assert page.evaluate("studio.state.revision") == 5
    click(page, 38, 20)
    page.keyboard.press("Enter")
    wait_revision(page, 6)
    click(page, 28, 10)
    page.keyboard.press("Escape")
    page.keyboard.press("Backspace")  # nothing is drawn: nothing happens
    page.keyboard.press("Control+z")
    wait_revision(page, 7)


def test_why_is_closed_by_escape_and_what_changes_elsewhere_is_undone_by_one_press(
    opened: Open, running: StudioProcess, map_yaml: Path
) -> None:
    page = opened(running)
    rectangles(page, ("1", (6, 6), (14, 12)), ("2", (27, 6), (35, 12)))
    wait_taught(page, 2)
    page.keyboard.press("v")
    click(page, 20.5, 20.5)
    page.wait_for_selector("#panel-why .scan-legend")
    seen = page.evaluate("studio.why.showsScan")
    page.get_by_role("switch", name="Its scan").click()
    assert seen and not page.evaluate("studio.why.showsScan")
    page.keyboard.press("Escape")
    assert page.evaluate("[studio.asked, studio.why.cell, studio.chosen]") == [None, None, None]
    assert page.locator("#panel-why .note").count() == 0
    page.evaluate(SAYS_THAT_MUCH_CHANGED)
    page.keyboard.press("r")
    drag(page, (27, 14), (35, 20))
    page.wait_for_selector("#toast >> text=25.0 m² became room.")
    assert page.evaluate("studio.flash") is not None
    page.locator("#toast").get_by_role("button", name="Undo").click()
    wait_revision(page, 4)
    assert page.locator("#toast").get_by_role("button", name="Undo").count() == 0
