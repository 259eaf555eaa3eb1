"""Formulas as MathML, which browsers draw by themselves: nothing is fetched from a network."""

from docutils import nodes
from latex2mathml.converter import convert


def inline(translator, node):
    """A formula in a line of text."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def displayed(translator, node):
    """A formula on lines of its own."""
    translator.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def setup(app):
    """Take the place of Sphinx's own renderers."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
