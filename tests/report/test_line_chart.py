import re

import pytest

from pgm_places.report.line_chart import Series, line_chart


def chart(y: list[float], **options: object) -> str:
    x = [float(step) for step in range(1, len(y) + 1)]
    return line_chart([Series("a", x, y, 0)], x_name="iteration", y_name="change", **options)  # type: ignore[arg-type]


def points(text: str) -> list[tuple[float, float]]:
    (found,) = re.findall(r'<polyline points="([^"]+)" class="line', text)
    return [(float(x), float(y)) for x, y in (pair.split(",") for pair in found.split())]


def test_larger_values_are_drawn_higher() -> None:
    (_, first), (_, second), (_, third) = points(chart([1.0, 3.0, 2.0]))
    assert second < third < first


def test_all_points_are_inside_the_drawing() -> None:
    assert all(0 <= x <= 420 and 0 <= y <= 270 for x, y in points(chart([-1e9, 5.0, 1e9])))


def test_values_over_decades_get_a_logarithmic_axis() -> None:
    (_, a), (_, b), (_, c) = points(chart([1.0, 0.1, 0.001]))
    assert (b - a) == pytest.approx((c - b) / 2, rel=1e-6, abs=0.2)


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([-123456.0, -124100.0], ["−123,600", "−124,000"]),
        ([0.95, 0.98], ["0.95", "0.98"]),
        ([1e-9, 2e-9], ["1.5e−9"]),
        ([0.0, 1.0], ["0.0", "0.5", "1.0"]),
        ([1.0, 1e-5], ["1e−5", "0.01"]),
    ],
)
def test_neighbouring_ticks_have_different_texts(values: list[float], texts: list[str]) -> None:
    labels = re.findall(r'text-anchor="end">([^<]+)<', chart(values))
    assert len(set(labels)) == len(labels) >= 2
    assert [text for text in texts if text not in labels] == []


def test_iterations_are_whole() -> None:
    labels = re.findall(r'text-anchor="middle">([^<]+)<', chart([1.0, 2.0]))
    assert labels[:2] == ["1", "2"]


def test_what_is_not_finite_is_left_out() -> None:
    assert len(points(chart([1.0, float("nan"), 2.0, float("inf")]))) == 2
    assert chart([float("nan")]) == ""


def test_long_lines_are_thinned_but_keep_their_ends() -> None:
    found = points(chart([float(step) for step in range(10_000)]))
    assert len(found) == 200
    assert found[0][0] == 88.0
    assert found[-1][0] == 408.0
