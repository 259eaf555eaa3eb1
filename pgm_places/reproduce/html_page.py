"""Finished sections as one HTML file that needs nothing else: tables and pictures are in it."""

import base64
from collections.abc import Sequence
from pathlib import Path

from pgm_places._version import __version__
from pgm_places.report.markup import Markup, element
from pgm_places.report.page_head import page_head
from pgm_places.reproduce.overview import PAPER_COLUMN, STAND_IN_WARNING, overview_table
from pgm_places.reproduce.section import Picture, Section, Table

__all__ = ["html_page"]

TITLE = "The paper’s experiments"


def html_page(sections: Sequence[Section], folder: Path) -> str:
    """The page as text.

    Parameters
    ----------
    sections : sequence of Section
    folder : Path
        Holds a folder with the pictures of each section.
    """
    links = [("overview", "Paper and ours")]
    links += [(_anchor(section), _title(section)) for section in sections]
    items = [element("li", element("a", words, href=f"#{key}")) for key, words in links]
    body = element(
        "body",
        element(
            "header",
            element("h1", TITLE),
            element("p", _summary(sections), class_="muted"),
            element("nav", element("ul", *items), aria_label="Sections"),
        ),
        element(
            "main",
            _warning(sections),
            element(
                "section",
                element("h2", "Paper and ours"),
                _table(overview_table(sections)),
                element("p", _NOTE, class_="muted"),
                id="overview",
            ),
            *(_section(section, folder) for section in sections),
        ),
        element("footer", f"Written by pgm-places {__version__}."),
    )
    return f"<!DOCTYPE html>\n{element('html', page_head(TITLE), body, lang='en')}\n"


_NOTE = (
    "Accuracy is the share of cells or steps with the right label, with its 95 % interval from "
    "blocks drawn anew; balanced is the mean recall of the labels. Doorways are few: accuracy "
    "hardly sees them, so F1 of the doorways stands beside it. A dash: the paper has no figure."
)


def _summary(sections: Sequence[Section]) -> str:
    ids = ", ".join(section.id for section in sections)
    return f"Sections {ids}; {sum(section.seconds for section in sections):.0f} s altogether."


def _warning(sections: Sequence[Section]) -> Markup:
    if all(section.real for section in sections):
        return Markup("")
    return element("div", element("strong", STAND_IN_WARNING), class_="warnings", role="note")


def _section(section: Section, folder: Path) -> Markup:
    pictures = [
        _figure(folder / section.id / item.file, item)
        for item in section.pictures
        if (folder / section.id / item.file).is_file()
    ]
    return element(
        "section",
        element("h2", _title(section)),
        element("p", element("strong", "The paper: "), section.paper) if section.paper else "",
        element("p", element("strong", "Here: "), section.setting),
        *([] if section.real else [element("p", "Generated buildings, not the paper’s.")]),
        *(_table(table) for table in section.tables),
        *(element("p", text, class_="muted") for text in section.remarks),
        *pictures,
        id=_anchor(section),
    )


def _title(section: Section) -> str:
    return f"{section.id} {section.title}" if section.paper else section.title


def _anchor(section: Section) -> str:
    return f"section-{section.id.replace('.', '-')}"


def _table(table: Table) -> Markup:
    """Columns of words are set left, columns of figures right."""
    left = [True, *(_is_words(column) for column in list(zip(*table.rows, strict=True))[1:])]
    head = element(
        "tr",
        *(
            _cell("th", name, words=words, scope="col")
            for name, words in zip(table.heading, left, strict=True)
        ),
    )
    paper = table.heading.index(PAPER_COLUMN) if PAPER_COLUMN in table.heading else None
    rows = [
        element(
            "tr",
            *(
                _cell("td" if k else "th", text, words=left[k], scope=None if k else "row")
                for k, text in enumerate(row)
            ),
            # What has a figure to compare with is found at a glance.
            style="background:var(--card)" if paper is not None and row[paper] != "-" else None,
        )
        for row in table.rows
    ]
    body = element(
        "table", element("caption", table.caption), element("thead", head), element("tbody", *rows)
    )
    return element("div", body, class_="scroll", tabindex="0", role="region")


def _cell(tag: str, text: str, *, words: bool, scope: str | None = None) -> Markup:
    styles = ["text-align:left"] if words else []
    if scope == "col":  # at spaces, never within a word
        styles += ["white-space:normal", "overflow-wrap:normal"]
    elif words:
        styles += ["white-space:normal", "min-width:8rem"]
    if scope == "row":
        styles.append("background:inherit")
    return element(tag, text, style=";".join(styles) or None, scope=scope)


def _is_words(cells: Sequence[str]) -> bool:
    """Whether most cells begin with a letter; dashes count for neither."""
    filled = [cell for cell in cells if cell not in ("", "-")]
    return 2 * sum(cell[0].isalpha() for cell in filled) > len(filled)


def _figure(path: Path, item: Picture) -> Markup:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    image = element(
        "img",
        src=f"data:image/png;base64,{data}",
        alt=item.caption,
    )
    return element("figure", image, element("figcaption", item.caption), class_="picture")
