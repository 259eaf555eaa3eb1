"""The head of every page: title, style, and a policy that keeps the page from loading anything."""

import base64
import hashlib

from pgm_places.report.markup import Markup, element
from pgm_places.report.page_style import STYLE

__all__ = ["page_head"]


def page_head(title: str, script: str = "") -> Markup:
    """The ``head`` element of a page whose only script, if any, is this one."""
    allowed = ""
    if script:
        digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
        allowed = f"script-src 'sha256-{digest}'; "
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"{allowed}base-uri 'none'; form-action 'none'"
    )
    # 'unsafe-inline' for styles: widths and colours of single elements are computed here.
    return element(
        "head",
        element("meta", charset="utf-8"),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{policy}">'),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="referrer", content="no-referrer"),
        element("title", title),
        Markup(f"<style>{STYLE}</style>"),
    )
