"""Charts: points where they belong, readable ticks, colours of the page's theme."""

import re
from collections.abc import Sequence

import pytest

from pgm_places.pictures.page import template_text
from pgm_places.report.line_chart import Line, line_chart


def svg(values: Sequence[float], name: str = "a", *, shares: bool = False) -> str:
    chart = line_chart(
        [Line.over_steps(name, values, 0)], x_name="iteration", y_name="change", shares=shares
    )
    assert chart is not None
    return chart.svg


def points(text: str) -> list[tuple[float, float]]:
    """The line's corners in the drawing, y down."""
    (found,) = re.findall(r'<g id="line-0">\s*<path d="([^"]+)"', text)
    return [(float(x), float(y)) for x, y in re.findall(r"[ML] (\S+) (\S+)", found)]


def texts(text: str, anchor: str) -> list[str]:
    return re.findall(rf"<text[^>]*text-anchor: {anchor}[^>]*>([^<]+)<", text.replace("−", "-"))


def test_larger_values_are_drawn_higher_inside_the_drawing_and_decades_evenly() -> None:
    (_, first), (_, second), (_, third) = points(svg([1.0, 3.0, 2.0]))
    assert second < third < first
    drawing = svg([-1e9, 5.0, 1e9])
    (width, height) = map(float, re.findall(r'viewBox="0 0 (\S+) (\S+)"', drawing)[0])
    assert all(0 <= x <= width and 0 <= y <= height for x, y in points(drawing))
    (_, a), (_, b), (_, c) = points(svg([1.0, 0.1, 0.001]))
    assert (b - a) == pytest.approx((c - b) / 2, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ([-123456.0, -124100.0], ["-123600", "-124000"]),
        ([0.95, 0.98], ["0.95", "0.98"]),
        ([0.0, 1.0], ["0.00", "1.00"]),
        ([1.0, 1e-5], ["1e-05", "0.01"]),
        ([3.0], ["2.9", "3.0"]),
        ([140776.1, 140776.5], ["140776.2", "140776.4"]),
    ],
)
def test_neighbouring_ticks_have_different_texts(values: list[float], wanted: list[str]) -> None:
    labels = texts(svg(values), "end")
    assert len(set(labels)) == len(labels) >= 2
    assert [text for text in wanted if text not in labels] == []


def test_iterations_are_whole() -> None:
    labels = texts(svg([1.0, 2.0, 3.0]), "middle")
    assert {"1", "2", "3"} <= set(labels)
    assert not any("." in label for label in labels if label[0].isdigit())


def test_what_is_not_finite_is_left_out() -> None:
    assert len(points(svg([1.0, float("nan"), 2.0, float("inf")]))) == 2
    nothing = Line.over_steps("a", [float("nan")], 0)
    assert line_chart([nothing], x_name="x", y_name="y") is None
    assert line_chart([], x_name="x", y_name="y") is None


def test_shares_have_a_diagonal_and_marks() -> None:
    assert "<use" in svg([0.25, 0.5], shares=True).split('id="line-0"')[1]
    assert texts(svg([0.25, 0.5], shares=True), "end")[-1] == "1.0"


def test_the_same_lines_give_the_same_file_without_a_date_mathematics_or_markup() -> None:
    drawing = svg([1.0, 2.0], "$x_{ <script>")
    assert drawing == svg([1.0, 2.0], "$x_{ <script>")
    assert not re.search(r"20\d\d-\d\d|dc:date", drawing)
    assert "$x_{ &lt;script&gt;" in drawing


def test_colours_are_those_of_the_theme_in_daylight_and_in_the_dark() -> None:
    drawing = svg([1.0, 2.0])
    assert "#abcd" not in drawing
    used = set(re.findall(r"var\((--\w+)\)", drawing))
    assert {"--m0", "--muted", "--rule"} <= used
    light, dark = template_text("theme.css").split("prefers-color-scheme: dark")
    assert all(f"{name}:" in light and f"{name}:" in dark for name in used)
    assert "prefers-color-scheme: dark" in drawing
