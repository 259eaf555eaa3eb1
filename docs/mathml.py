"""Formulas as MathML, which browsers render without downloads."""

import re

from docutils import nodes
from latex2mathml.converter import convert

FUNCTION = re.compile(r"<mi>(arg|log|exp|ln|sin|cos)</mi>")


def mathml(formula, display):
    """The formula as MathML, with the space around functions that TeX has."""
    made = convert(formula, display=display).replace(r"<mi>\arg</mi>", "<mi>arg</mi>")
    if "\\" in made:
        raise ValueError(f"a formula that MathML cannot show: {formula}")
    return FUNCTION.sub(r'<mo form="prefix" lspace="0.17em" rspace="0.17em">\1</mo>', made)


def inline(translator, node):
    """A formula in a line of text."""
    translator.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def displayed(translator, node):
    """A formula on lines of its own."""
    translator.body.append(f'<div class="math">{mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def setup(app):
    """Take the place of Sphinx's own renderers."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
