"""What axe-core finds on every panel: ``python -m tests.studio.accessibility axe.min.js``.

The script is that of the npm package ``axe-core``; it is not part of this repository.
"""

import sys
import tempfile
from pathlib import Path

from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation import generate_building
from tests.studio.browser import launched, studio
from tests.studio.pictures import settled

PANELS = ("paint", "layers", "review", "why")
ASK = "axe.run().then((found) => found.violations.map((v) => [v.impact, v.id, v.nodes.length]))"


def main(script: str) -> int:
    """Print every finding; how many there are."""
    findings = 0
    with tempfile.TemporaryDirectory() as name, launched() as browser:
        save_map(generate_building(size="small").grid, Path(name) / "small")
        with studio(Path(name) / "small.yaml", "--out", Path(name) / "kept") as process:
            for theme in ("light", "dark"):
                for width in (1300, 390):
                    context = browser.new_context(
                        viewport={"width": width, "height": 820},
                        color_scheme=theme,
                        bypass_csp=True,  # to bring axe in; the page's policy would refuse it
                    )
                    page = context.new_page()
                    page.goto(process.address)
                    settled(page)
                    page.evaluate(f"{script}; 0")
                    page.keyboard.press("b")
                    for panel in PANELS:
                        if page.get_attribute(f"#tab-{panel}", "aria-selected") != "true":
                            page.click(f"#tab-{panel}")
                        if panel == "review":
                            page.keyboard.press("n")
                        found = page.evaluate(ASK)
                        findings += len(found)
                        for item in found:
                            print(theme, width, panel, *item)  # noqa: T201
                    page.evaluate("studio.exports.open()")
                    page.wait_for_selector("#export[open]")
                    for item in page.evaluate(ASK):
                        findings += 1
                        print(theme, width, "export", *item)  # noqa: T201
                    context.close()
    print(f"{findings} findings")  # noqa: T201
    return findings


if __name__ == "__main__":
    sys.exit(min(1, main(Path(sys.argv[1]).read_text(encoding="utf-8"))))
