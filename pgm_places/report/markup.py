"""HTML that cannot be forgotten to be escaped: text is escaped unless it is Markup already."""

import html
from collections.abc import Iterable, Sequence
from typing import Any

__all__ = ["Markup", "data_table", "element", "escaped", "joined"]

_EMPTY = {"br", "img", "meta"}


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def escaped(content: object) -> Markup:
    """The content as HTML text; Markup stays as it is."""
    if isinstance(content, Markup):
        return content
    text = str(content).encode("utf-8", "replace").decode("utf-8")
    return Markup(html.escape(text, quote=True))


def joined(parts: Iterable[object], separator: str = "") -> Markup:
    """The parts one after another, each escaped."""
    return Markup(escaped(separator).join(escaped(part) for part in parts))


def element(tag: str, *content: object, **attributes: Any) -> Markup:
    """An element with its content, escaped.

    In attribute names a trailing underscore is dropped and others become hyphens; an attribute that
    is None or False is left out, True stands alone.

    Examples
    --------
    >>> element("p", "1 < 2", class_="note", hidden=True)
    '<p class="note" hidden>1 &lt; 2</p>'
    """
    words = [tag]
    for key, value in attributes.items():
        name = key.rstrip("_").replace("_", "-")
        if value is True:
            words.append(name)
        elif value is not None and value is not False:
            words.append(f'{name}="{escaped(str(value))}"')
    opening = f"<{' '.join(words)}>"
    if tag in _EMPTY:
        return Markup(opening)
    return Markup(f"{opening}{joined(content)}</{tag}>")


def data_table(
    caption: object, heading: Sequence[object], rows: Sequence[Sequence[object]], **attributes: Any
) -> Markup:
    """A table with a caption, in a box that scrolls sideways; each row's first cell is its head."""
    head = element("tr", *(element("th", name, scope="col") for name in heading))
    lines = [
        element(
            "tr", element("th", row[0], scope="row"), *(element("td", cell) for cell in row[1:])
        )
        for row in rows
    ]
    table = element(
        "table",
        element("caption", caption),
        element("thead", head),
        element("tbody", *lines),
        **attributes,
    )
    return element("div", table, class_="scroll", tabindex="0", role="region", aria_label=caption)
