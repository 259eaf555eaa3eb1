import base64
import hashlib
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pgm_places.cli.terminal import comparison_table
from pgm_places.errors import OutputError
from pgm_places.evaluation.bootstrap import Interval, SignTest
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.evaluated_items import EvalMap
from pgm_places.experiment.significance import Difference
from pgm_places.inference.labeling import Status
from pgm_places.palette import LABEL_COLOURS, rgb_of
from pgm_places.report.comparison_files import comparison_record
from pgm_places.report.comparison_page import report_page, summary_of, write_report
from pgm_places.report.comparison_tables import comparison_tables
from pgm_places.spaces.doorways import DoorScores
from tests.report.comparisons import small_comparison

HISTORY = {
    "history": {"change": [0.5, 0.1, 0.001], "energy": [-10.0, -12.0], "accuracy": [0.9, 0.95]}
}
EMPTY = {"meta", "img", "br", "link", "input"}


class Reader(HTMLParser):
    """The elements of a page, with a check that they are closed in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(page)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in EMPTY:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "script" not in self._open and "style" not in self._open:
            self.words.append(data)

    def all(self, tag: str) -> list[dict[str, Any]]:
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def text(self) -> str:
        return " ".join(self.words)


def picture_of(source: str) -> Any:
    data = base64.b64decode(source.removeprefix("data:image/png;base64,"), validate=True)
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image.convert("RGB"))


def test_a_report_says_what_was_found(tmp_path: Path) -> None:
    path = write_report(small_comparison(info=HISTORY), tmp_path / "report.html")
    assert path.read_text("utf-8") == report_page(small_comparison(info=HISTORY))
    page = Reader(path.read_text("utf-8"))
    for words in ("A comparison", "relaxation", "96.3", "converged", "2.500", "ab" * 32, "1.2.3"):
        assert words in page.text
    assert Status.CONVERGED.meaning in page.text and Status.STOPPED.meaning not in page.text
    headings = [tag for tag, _ in page.elements if re.fullmatch("h[1-6]", tag)]
    assert headings.count("h1") == 1
    assert {"h2", "h3"} <= set(headings)


def test_nothing_is_loaded_from_elsewhere() -> None:
    text = report_page(small_comparison(info=HISTORY))
    assert not re.search(r"https?:|//[a-z0-9.-]+\.[a-z]{2,}|@import|url\(", text)
    page = Reader(text)
    assert not page.all("link") and not page.all("iframe")
    assert all("src" not in script for script in page.all("script"))
    assert {image["src"].partition(":")[0] for image in page.all("img")} == {"data"}
    assert all(link["href"].startswith("#") for link in page.all("a"))
    sections = {section["id"] for section in page.all("section")}
    assert {link["href"].removeprefix("#") for link in page.all("a")} == sections


def test_the_policy_lets_only_the_reports_own_script_run() -> None:
    text = report_page(small_comparison())
    policy = next(m for m in Reader(text).all("meta") if "http-equiv" in m)["content"]
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy.startswith("default-src 'none'")
    assert f"script-src 'sha256-{digest}'" in policy


NO_BREAK = "\u00a0"
EVIL = "\"><script>alert('x')</script><img src=x onerror=alert(1)>&amp;{{"


@pytest.mark.parametrize(
    "arguments",
    [
        {"title": EVIL},
        {"label_names": ("corridor", EVIL, "doorway")},
        {"map_names": (EVIL, "other")},
        {"method_id": EVIL, "info": HISTORY},
        {"info": {"history": {EVIL: [1.0, 2.0]}, "iterations": EVIL}},
        {"warnings": (EVIL,)},
        {"config": {EVIL: [EVIL]}},
        {"versions": {EVIL: EVIL}},
        {"inputs": {EVIL: EVIL}},
        {"stage_seconds": {EVIL: 1.0}},
    ],
    ids=lambda arguments: next(iter(arguments)),
)
def test_every_text_from_outside_is_escaped(arguments: dict[str, Any]) -> None:
    page = Reader(report_page(small_comparison(**arguments)))
    assert len(page.all("script")) == 1
    assert not any("onerror" in attributes for _, attributes in page.elements)
    assert "alert('x')" in page.text or any(
        EVIL in str(value) for _, attributes in page.elements for value in attributes.values()
    )


def test_odd_characters_do_not_break_the_file(tmp_path: Path) -> None:
    path = write_report(small_comparison(title="\ud800 部屋 \x00"), tmp_path / "report.html")
    assert "部屋" in path.read_text("utf-8")


@pytest.mark.parametrize(
    "arguments",
    [
        {"beliefs": False},
        {"info": {}},
        {"info": {"history": None}},
        {"info": {"history": {"change": [], "labels": ["a"], "grid": [[1.0], [2.0]]}}},
        {"info": {"history": {"energy": [float("nan"), 1.0, float("inf")]}}},
        {"info": {"history": {"energy": [3.0]}}},
        {"info": {"history": {"energy": [7.0, 7.0, 7.0]}}},
        {"info": {"history": {"change": np.geomspace(1, 1e-12, 5000)}}},
        {"label_names": ("room", "corridor")},
        {"label_names": tuple(f"label {k}" for k in range(12))},
        {"stage_seconds": {}, "config": {}, "versions": {}, "inputs": {}},
    ],
)
def test_optional_parts_may_be_missing(arguments: dict[str, Any]) -> None:
    assert Reader(report_page(small_comparison(**arguments))).all("h2")


def test_a_label_that_never_occurs_has_dashes() -> None:
    comparison = small_comparison(label_names=("corridor", "room", "doorway", "lift"))
    never = Evaluation(comparison.label_names, np.diag([5, 5, 5, 0]))
    methods = tuple(replace(method, evaluation=never) for method in comparison.methods)
    assert "–" in Reader(report_page(replace(comparison, methods=methods))).text


def test_maps_are_the_right_way_up_and_described() -> None:
    comparison = small_comparison()
    page = Reader(report_page(comparison))
    truth = next(image for image in page.all("img") if "ground truth" in image["alt"])
    picture = picture_of(truth["src"])
    # Labels run from left to right: the first free column is corridor, the next one room.
    scale = picture.shape[1] // comparison.maps[0].grid.shape[1]
    rows, columns = (scale * np.array(part) + scale // 2 for part in ([1, 2], [1, 2]))
    assert picture[rows[1], columns[0]].tolist() == rgb_of(LABEL_COLOURS[0]).tolist()
    assert picture[rows[1], columns[1]].tolist() == rgb_of(LABEL_COLOURS[1]).tolist()
    # The unknown cell (0, 0) is at the lower left; the cell without truth just inside of it.
    assert picture[-1, 0].tolist() == [220, 220, 220]
    assert picture[0, 0].tolist() == rgb_of("#2d2d2d").tolist()
    assert picture[-1 - scale - scale // 2, columns[0]].min() > 230
    pictures = [image for image in page.all("img") if image["src"] != "data:,"]
    assert pictures and all(image["alt"] for image in pictures)


def test_figures_of_several_maps_stand_apart() -> None:
    page = Reader(report_page(small_comparison(map_names=("one", "two"))))
    layers = {button["data-map"] for button in page.all("button") if "data-map" in button}
    assert layers == {"0", "1"}
    assert "Accuracy / balanced accuracy by map" in page.text


def test_doors_are_counted_in_all_and_by_map() -> None:
    doors = (DoorScores(doors=5, found=4, accepted=6, right=3), DoorScores(3, 3, 3, 3))
    comparison = small_comparison(map_names=("one", "two"), doors=doors)
    page = report_page(comparison)
    table = re.search(r"<caption>Doors.*?</table>", page, re.DOTALL)
    assert table is not None
    assert re.findall(r"<td>(.*?)</td>", table[0])[:5] == [
        *("7 / 1 / 3", "87.5", "66.7"),
        *("4 / 1 / 3", "3 / 0 / 0"),
    ]
    record = comparison_record(comparison)["methods"]["plain"]
    assert record["doors"] == {
        "found": 7,
        "missed": 1,
        "invented": 3,
        "recall": 0.875,
        "precision": 6 / 9,
    }
    assert record["maps"]["two"]["doors"]["found"] == 3
    gates = DoorScores(doors=8, found=0, accepted=0, right=0)
    by_gates = replace(comparison, gates=(gates, DoorScores(0, 0, 0, 0)))
    table = re.search(r"<caption>Doors.*?</table>", report_page(by_gates), re.DOTALL)
    assert table is not None
    [*_, row] = table[0].split("<tr>")
    assert "gates, before any method" in row
    assert re.findall(r"<td>(.*?)</td>", row)[:3] == ["0 / 8 / 0", "0.0", "–"]
    assert comparison_record(by_gates)["gates"]["precision"] is None
    [row] = [line for line in comparison_table(by_gates).splitlines() if line[:5] == "gates"]
    assert row.split()[-5:] == ["0/8/0", "0.0", "-", "0/8/0", "0/0/0"]
    without = small_comparison()
    assert "Doors: found" not in report_page(without)
    assert "doors" not in comparison_record(without)["methods"]["plain"]


def test_every_table_has_a_caption_and_headed_rows() -> None:
    text = report_page(small_comparison(info=HISTORY))
    tables = re.findall(r"<table.*?</table>", text, re.DOTALL)
    assert len(tables) > 5
    for table in tables:
        assert 'scope="row"' in table


def test_an_unwritable_path_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot write"):
        write_report(small_comparison(), tmp_path / "file" / "report.html")
    assert [part.name for part in tmp_path.iterdir()] == ["file"]


def test_learned_weights_have_their_certificate_and_their_history() -> None:
    comparison = small_comparison(method_id="amn")
    learned = {
        "objective": 2.0,
        "lower_bound": 1.99,
        "certified_objective": 2.01,
        "certified_gap": 0.00995,
        "status": "optimal",
        "iterations": 41,
    }
    amn = replace(
        comparison.methods[1],
        learned=learned,
        learning={"objective": [9.0, 3.0, 2.0], "lower bound": [0.0, 1.0, 1.99]},
    )
    page = report_page(replace(comparison, methods=(comparison.methods[0], amn)))
    text = Reader(page).text
    assert "Distance of the learned weights from the optimum" in text
    assert all(word in text for word in ("2.010", "1.990", "1.00", "41"))
    assert "amn: learning" in text
    assert "learned weights" not in Reader(report_page(comparison)).text


def test_charts_are_images_that_say_what_they_show() -> None:
    page = Reader(report_page(small_comparison(info=HISTORY)))
    charts = [image for image in page.all("img") if "svg" in image["src"]]
    words = [chart["alt"] for chart in charts]
    assert len(charts) == 4
    assert any(text.startswith("accuracy over confidence. relaxation (ECE ") for text in words)
    assert "energy over iteration. relaxation: from -10 to -12" in words


def marks(page: str) -> list[int]:
    """The number of marked figures in each row of the first table of results."""
    table = page.split('id="results"', 1)[1].split("By label", 1)[0].split("Differences", 1)[0]
    rows = re.findall(r"<tr>.*?</tr>", table, re.DOTALL)
    return [len(re.findall(r'class="best', row)) for row in rows]


def wrong_everywhere(comparison: Comparison) -> MethodResult:
    """The first method with another label than the true one in every cell."""
    labels = [(np.maximum(item.node_truth, 0) + 1) % 3 for item in comparison.maps]
    return relabelled(comparison, comparison.methods[0], labels)


def relabelled(
    comparison: Comparison, method: MethodResult, labels: list[NDArray[np.int64]]
) -> MethodResult:
    """A method with other labels, by map."""
    labelings = [
        replace(found, labels=of_map)
        for found, of_map in zip(method.labelings, labels, strict=True)
    ]
    evaluations = [
        evaluate(item.node_truth, found.labels, comparison.label_names)
        for item, found in zip(comparison.maps, labelings, strict=True)
    ]
    merged = Evaluation.merged(evaluations)
    return replace(
        method, labelings=tuple(labelings), evaluations=tuple(evaluations), evaluation=merged
    )


def test_what_is_better_beyond_chance_is_marked() -> None:
    comparison = small_comparison(map_names=("a", "b"))
    assert marks(report_page(comparison)) == [0, 0, 0]  # both methods label alike
    worse = replace(comparison, methods=(wrong_everywhere(comparison), comparison.methods[1]))
    assert marks(report_page(worse)) == [0, 0, 5]


def test_the_first_page_says_who_is_right_more_often_and_what_it_costs() -> None:
    comparison = small_comparison(map_names=("a", "b"))
    text = Reader(report_page(comparison)).text.replace(NO_BREAK, " ")
    assert (
        "No difference in accuracy is shown between plain and relaxation: 96.3 against 96.3 % of"
        in text
    )
    assert "the same labels as plain" in text
    worse = replace(comparison, methods=(wrong_everywhere(comparison), comparison.methods[1]))
    text = Reader(report_page(worse)).text.replace(NO_BREAK, " ")
    assert "relaxation labels 96.3 points more cells correctly than plain: 96.3 against" in text
    assert "(95 % interval of the difference: " in text
    assert "; relaxation finds 100 % of the room cells, plain 0 % (balanced accuracy " in text
    assert "ahead in 2 and behind in 0 of 2 buildings (sign test: p = 0.5)" in text
    assert "relaxation learns in 1.50 s and labels in 0.25 s; plain learns in 1.50 s" in text
    assert "significantly best" in text
    alone = replace(comparison, methods=comparison.methods[:1])
    assert "At a glance" not in report_page(alone)
    one = small_comparison()
    worse = replace(one, methods=(wrong_everywhere(one), one.methods[1]))
    text = Reader(report_page(worse)).text
    assert "more cells correctly than plain" in text and "(sign test" not in text


def test_of_the_papers_methods_the_first_page_compares_these() -> None:
    comparison = small_comparison()
    plain, other = comparison.methods
    third = replace(wrong_everywhere(comparison), id="amn", name="AssociativeMarkovNetwork")
    found = replace(comparison, methods=(plain, replace(other, name="Relaxation"), third))
    first = replace(found, methods=tuple(reversed(found.methods)))
    for one in (found, first):
        standings = summary_of(one)
        assert standings is not None and len(standings.standings) == 3
    glance = summary_of(replace(found, methods=(found.methods[1], plain, third)))
    assert glance is not None
    assert re.match(r"relaxation labels \S+ points more cells .* than amn", glance.headline)


def test_the_ground_truth_is_counted_in_cells_and_square_metres() -> None:
    page = report_page(small_comparison())  # cells of 0.5 m
    [table] = re.findall(r"<table[^>]*>\s*<caption>Ground truth.*?</table>", page, re.DOTALL)
    rows = [re.findall(r"<td>(.*?)</td>", row) for row in table.split("<tr>")[2:]]
    assert rows == [["11", "2.8", "40.7"], ["8", "2.0", "29.6"], ["8", "2.0", "29.6"]]
    assert "Labelling every cell “corridor” would reach 40.7\u00a0% accuracy." in Reader(page).text


def test_differences_are_written_down_for_programs_and_listed_in_terminals() -> None:
    comparison = small_comparison(map_names=("a", "b"))
    worse = replace(comparison, methods=(wrong_everywhere(comparison), comparison.methods[1]))
    record = comparison_record(worse)
    assert record["best"] == {"accuracy": "relaxation", "balanced_accuracy": "relaxation"}
    accuracy, balanced = record["differences"]
    assert (accuracy["first"], accuracy["second"]) == ("plain", "relaxation")
    assert accuracy["difference"] == pytest.approx(-26 / 27) and accuracy["high"] < 0
    assert accuracy["buildings"] == {"ahead": 0, "even": 0, "behind": 2, "p": 0.5}
    assert accuracy["better"] == balanced["better"] == "relaxation"
    table = comparison_table(worse)
    [row] = [line for line in table.splitlines() if line.startswith("relaxation ") and "to" in line]
    assert row.split()[1:3] == ["plain", "+96.3*"] and "2/0/0" in row
    assert "* significantly better on blocks of the 2 test buildings, which says nothing" in table


@pytest.mark.parametrize(
    ("n_buildings", "words"),
    [
        (1, "better on blocks of the test building, which says nothing of others, or"),
        (6, "better, or"),
    ],
)
def test_a_star_names_the_blocks_if_buildings_are_too_few(n_buildings: int, words: str) -> None:
    comparison = small_comparison(map_names=tuple("abcdef"[:n_buildings]))
    worse = replace(comparison, methods=(wrong_everywhere(comparison), comparison.methods[1]))
    assert f"(* significantly {words} the highest of a split;" in comparison_table(worse)


def test_terminal_page_and_results_show_one_record() -> None:
    comparison = small_comparison(map_names=("a", "b"), doors=(DoorScores(3, 3, 3, 3),) * 2)
    worse = replace(comparison, methods=(wrong_everywhere(comparison), comparison.methods[1]))
    tables, printed = comparison_tables(worse), comparison_table(worse).splitlines()
    record = json.loads(json.dumps(comparison_record(worse)))["tables"]
    assert list(record) == list(tables)
    page = report_page(worse)
    for name, table in tables.items():
        [found] = re.findall(rf"<caption>{table.caption}</caption>.*?</table>", page, re.DOTALL)
        cells = re.findall(r"<td[^>]*>(.*?)(?:<small.*?)?</td>", found)
        assert cells == [cell.text for row in table.rows for cell in row.cells]
        assert record[name]["rows"] == [[r.head, *(c.text for c in r.cells)] for r in table.rows]
        if name not in ("truth", "by_map", "certificates"):
            first = printed.index(table.caption) + 4
            for row, line in zip(table.rows, printed[first:], strict=False):
                words = " ".join([row.head, *map(str, row.cells)])
                assert line.split() == words.split()


def test_what_was_chosen_on_training_data_is_said_everywhere() -> None:
    found = small_comparison(choices={"unary": "context (held-out balanced accuracy 91.2)"})
    chosen = replace(found.methods[1], choices={"C": "10 (held-out accuracy 90.0)"})
    found = replace(found, methods=(found.methods[0], chosen))
    lines = comparison_table(found).splitlines()
    assert lines[-2:] == [
        "unary: context (held-out balanced accuracy 91.2)",
        "relaxation, C: 10 (held-out accuracy 90.0)",
    ]
    text = Reader(report_page(found)).text
    assert "Chosen on training data" in text
    assert "91.2" in text and "relaxation, C" in text
    record = comparison_record(found)
    assert record["choices"] == found.choices
    assert record["methods"]["relaxation"]["choices"] == chosen.choices


def test_the_first_sentence_weighs_accuracy_and_rare_labels() -> None:
    """One method labels all of the rare label and errs elsewhere, the other passes over it."""
    comparison = small_comparison(map_names=tuple("abcdefgh"))
    plain, other = comparison.methods
    rare, maps = 2, []
    for item in comparison.maps:
        assert isinstance(item, EvalMap)
        truth = np.where(np.arange(len(item.node_truth)) % 9 == 0, rare, 0)
        maps.append(replace(item, truth=item.layout.to_raster(truth.astype(np.int16), fill=-1)))
    found = replace(comparison, maps=tuple(maps))
    common = [np.zeros(len(item.node_truth), np.int64) for item in maps]
    doubtful = [np.where(np.arange(len(item.node_truth)) % 3 == 0, rare, 0) for item in maps]
    methods = relabelled(found, plain, common), relabelled(found, other, doubtful)
    glance = summary_of(replace(found, methods=methods))
    assert glance is not None
    assert glance.headline.startswith("plain labels ")
    assert "; relaxation finds 100 % of the doorway cells, plain 0 % (balanced" in glance.headline


def test_printed_differences_are_those_of_printed_figures() -> None:
    interval, signs = Interval(0.0169, 0.01, 0.02), SignTest(0, 0, 0)
    found = Difference("a", "b", "accuracy", interval, signs, values=(0.98844, 0.97154))
    assert found.shown == pytest.approx(0.016)  # 98.8 - 97.2
    assert found.reversed().shown == pytest.approx(-0.016)
    alike = Difference("a", "b", "accuracy", Interval(0.0002, 0, 1), signs, values=(0.5002, 0.5))
    assert alike.shown == pytest.approx(0.0002)


def test_learning_takes_some_time_or_is_not_there() -> None:
    comparison = small_comparison()
    plain, other = comparison.methods
    plain = replace(plain, seconds={"learn": 0.0, "infer": 0.1})
    other = replace(other, seconds={"learn": 0.004, "infer": 0.1})
    quick = replace(comparison, methods=(plain, other))
    text = Reader(report_page(quick)).text
    assert "relaxation learns in less than 0.01 s" in text
    assert "plain needs no learning" in text
    assert "learns nothing" not in text
    assert "< 0.01" in comparison_table(quick)


def test_node_marginals_are_kept_on_request() -> None:
    comparison = small_comparison(info={"node_marginals": np.ones((27, 3)), "integral": True})
    maps = comparison_record(comparison)["methods"]["relaxation"]["maps"]
    assert maps["floor"]["info"] == {"integral": True}
    kept = comparison_record(comparison, marginals=True)["methods"]["relaxation"]["maps"]
    assert len(kept["floor"]["info"]["node_marginals"]) == 27
