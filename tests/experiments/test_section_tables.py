import pytest

from experiments import __main__ as experiments
from experiments.page_tables import marks, parsed_tables, with_table
from experiments.paper.section import Finding, Section, Table
from experiments.section_tables import paper_table, section_tables
from experiments.trajectories import CHAIN, JOINT, LOOPS, graphs_shown

KEPT = dict(experiments.kept_tables())


def section(key: str, *tables: Table, findings: tuple[Finding, ...] = ()) -> Section:
    return Section(key, key, "the paper", True, 1.0, "0", "", findings, tables)


@pytest.mark.parametrize("name", KEPT)
def test_the_page_shows_what_is_kept(name: str) -> None:
    [page] = [mark.page for mark in marks() if mark.name == name]
    text = page.read_text(encoding="utf-8")
    assert with_table(text, name, KEPT[name]) == text, "run: python -m experiments --compose"


def test_only_findings_that_the_paper_has_stand_beside_it() -> None:
    found = section("7.5", findings=(Finding("a", 0.9, paper=0.8), Finding("b", 0.7)))
    [table] = parsed_tables(paper_table({"7.5": found}))
    assert table.heading == ("experiment", "paper", "by default")
    assert table.rows == (("7.5 a", "80.0", "90.0 / -"),)


def test_several_tables_have_captions() -> None:
    one, two = Table("One", ("a",), (("1",),)), Table("Two", ("b",), (("2",),))
    assert section_tables(section("7.1", one)).startswith("| a |")
    assert section_tables(section("7.1", one, two)).startswith("One:\n\n| a |")


def test_a_method_for_chains_alone_has_no_row_among_other_graphs() -> None:
    graphs = (CHAIN, LOOPS, JOINT)
    text = (
        f"| drives | method | {' | '.join(graphs)} |\n"
        "|---|---|---|---|---|\n| log | filter | 1 | - | - |\n| log | potts | 2 | 3 | - |\n"
    )
    chain, loops = parsed_tables(graphs_shown(text))
    assert chain.rows == (("filter", "1"), ("potts", "2"))
    assert loops.rows == (("potts", "3"),)
