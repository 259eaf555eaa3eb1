"""How the software is cited agrees with what it is."""

import re
from pathlib import Path

import yaml

from pgm_places import __version__
from pgm_places.inference.labeling import Status
from pgm_places.models.decoders import DECODERS

ROOT = Path(__file__).parents[1]


def page(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def table_of_papers() -> str:
    """The table of papers by method."""
    return page("methods.md").split("## How to cite")[1]


def last_release() -> str:
    """The newest version with a heading in the changelog that is not in preparation."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    return next(
        version
        for version in re.findall(r"^## (\d+\.\d+\.\d+)", text, re.MULTILINE)
        if f"{version}.dev0" != __version__
    )


def test_the_citation_names_the_last_release() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["cff-version"] == "1.2.0"
    assert str(cited["version"]) == last_release()
    assert cited["license"] == "MIT"
    assert {"title", "authors", "message"} <= set(cited)
    assert f"version = {{{last_release()}}}" in page("references.bib")


def test_every_paper_that_is_named_has_an_entry_and_every_entry_is_named() -> None:
    named = set(re.findall(r"`([a-z]+\d{4})`", table_of_papers()))
    entries = page("references.bib")
    written = set(re.findall(r"^@\w+\{([a-z]+\d{4}),", entries, re.MULTILINE))
    assert named == written - {"mozos2007supervised"}
    assert entries.count("{") == entries.count("}")


def test_every_decoder_is_cited_but_local_search() -> None:
    table = table_of_papers()
    assert [name for name in DECODERS if f"`{name}`" not in table] == ["icm"]


def test_every_word_of_a_status_is_explained() -> None:
    assert all(f"| `{word}` |" in page("inference.md") for word in Status)
