"""Sphinx configuration."""

import re
import sys
from pathlib import Path

from pgm_places._version import __version__

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "plugins"))

project = "pgm_places"
author = "The pgm_places developers"
copyright = "2026, The pgm_places developers"
release = version = __version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",
]
html_math_renderer = "mathml"
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_static"]
templates_path = ["_templates"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

autosummary_generate = True
here = Path(__file__).parent
api_page = (here / "api.md").read_text(encoding="utf-8")
for stale in (here / "api").glob("*.rst"):  # pages of modules that were renamed since
    if f"   {stale.stem}\n" not in api_page:
        stale.unlink()
autodoc_typehints = "none"  # the docstrings give shapes and units, which types cannot
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "/plot_",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_signature": False,
    "thumbnail_size": (640, 448),
    "abort_on_example_error": True,
    "capture_repr": (),
}

html_theme = "pydata_sphinx_theme"
html_title = "pgm_places"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_js_files = [("pages.js", {"defer": "defer"})]
html_show_sourcelink = False
html_sidebars = {
    "index": [],
    "changelog": [],
    "results": [],
    "gallery/index": [],
    "sg_execution_times": [],
}
MOVED = {
    "factors": "inference.html#factors-and-network-files",
    "potts": "methods.html#the-potts-field",
    "releasing": "development.html#releasing",
    "semi_markov": "hmm.html#the-semi-markov-model",
}
"""Pages that are sections of others now, and where they are."""

html_additional_pages = dict.fromkeys(MOVED, "moved.html")
html_context = {"moved": MOVED}
html_theme_options = {
    "navigation_with_keys": True,
    "show_toc_level": 2,
    "header_links_before_dropdown": 7,
    "show_nav_level": 1,
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
}


WRITTEN_BY = re.compile(r"<!-- table: [^,>]+, by (python -m [^>]+?) -->\n")
"""Where a command writes a table (experiments/page_tables.py)."""

ROW = re.compile(r"^\|.*", re.MULTILINE)
FIGURES = re.compile(r"(?<=\d) (/|to|of|±) (?=\d)")


def prepare_tables(_app, _page, source):
    """Set commands above the tables that they have written; keep figures like 1 / 2 together."""
    text = WRITTEN_BY.sub(r":::{div} written-by\n`\1`\n:::\n", source[0])
    source[0] = ROW.sub(lambda row: FIGURES.sub("\u00a0\\1\u00a0", row[0]), text)


def setup(app):
    """Prepare tables; leave out methods whose text refers to pages of scikit-learn."""
    app.connect("source-read", prepare_tables)

    def skip(*event):
        _app, _what, name, _obj, skipped, _options = event
        return True if name.startswith("set_") and name.endswith("_request") else skipped

    app.connect("autodoc-skip-member", skip)
