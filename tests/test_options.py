"""Options are refused alike wherever they come from: Python, TOML and flags of the command line."""

import dataclasses
import inspect
import itertools
import math
import re
import subprocess
import sys
import tomllib
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from annotated_types import Interval, Predicate
from annotated_types import Le as TheirLe

from pgm_places.cli.app import run
from pgm_places.cli.declarations import flag_of, option_flags
from pgm_places.errors import ConfigError
from pgm_places.experiment.config import parse_config
from pgm_places.inference.backends import BACKENDS, METHODS, build
from pgm_places.options import (
    AtLeastZero,
    AtLeastZeroOrInfinite,
    OptionError,
    Positive,
    Whole,
    check_option,
    check_options,
    from_mapping,
    option_hints,
    option_lines,
    option_values,
    plain_values,
)
from pgm_places.options.marks import Ge, Gt, Le, Lt, MinLen, describe_type
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.simulation.map_simulation import MapSimulation
from pgm_places.simulation.odometry_noise import OdometryNoise
from pgm_places.simulation.robot_options import LaserOptions, RobotMotion
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.topology.rules import TopologyOptions
from pgm_places.unary.options import ClassifierOptions, ContextOptions
from pgm_places.unary.scan_model import BeamOptions

TABLES = {
    "sensor": Sensor,
    "sensor.noise": SensorNoise,
    "classifier": ClassifierOptions,
    "context": ContextOptions,
    "topology": TopologyOptions,
}
"""The classes that a table of a configuration fills."""

OTHERS = (OdometryNoise, LaserOptions, SimulatedRobot, BeamOptions, MapSimulation)
"""Classes of options that no table fills."""

FREE = {(name, option) for name in ("amn", "crf") for option in ("node_features", "edge_features")}
"""Options that are strings with a grammar of their own."""

Case = tuple[str, Any]


WRONG_KIND: dict[Any, list[Any]] = {
    str: [3, True],
    bool: [1, "yes"],
    int: [1.5, True, "many"],
    float: ["much", True, math.nan],
}


def bad_values(hint: Any) -> list[Any]:
    """Values that an annotation must refuse: of another type, and just out of each limit."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        arms = typing.get_args(hint)
        outside = [value for arm in arms for mark in _marks(arm) for value in _outside(mark)]
        table = {"a": "much"} if Mapping[str, Positive] in arms else {"a": 1}
        return [table, True, *outside, *([] if str in arms else ["no such choice"])]
    base = typing.get_args(hint)[0] if _marks(hint) else hint
    if typing.get_origin(hint) is Literal or base not in WRONG_KIND:
        return [{"a": 1}, "no such choice", 17]
    return [{"a": 1}, *WRONG_KIND[base], *(v for mark in _marks(hint) for v in _outside(mark))]


def _marks(hint: Any) -> tuple[Any, ...]:
    return getattr(hint, "__metadata__", ())


def _outside(mark: Any) -> list[Any]:
    if isinstance(mark, Ge):
        return [mark.limit - 1]
    if isinstance(mark, Gt):
        return [mark.limit]
    if isinstance(mark, Le):
        return [mark.limit + 1]
    if isinstance(mark, Lt):
        return [mark.limit]
    return [[]] if isinstance(mark, MinLen) else []


def cases(cls: type[Any]) -> list[Case]:
    return [(name, value) for name, hint in option_hints(cls).items() for value in bad_values(hint)]


def table_cases() -> list[tuple[str, str, Any]]:
    return [(table, *case) for table, cls in TABLES.items() for case in cases(cls)]


def method_cases() -> list[tuple[str, str, Any]]:
    return [
        (name, *case)
        for name in BACKENDS
        for case in cases(METHODS.find(name))
        if (name, case[0]) not in FREE
    ]


def refusal(action: Callable[[], Any]) -> str:
    with pytest.raises(ConfigError) as caught:
        action()
    message = str(caught.value)
    assert "\n" not in message
    return message


def in_python(cls: type[Any], name: str, value: Any) -> str:
    message = refusal(lambda: cls(**{name: value}))
    assert message.startswith(f"{name} must be ")
    assert message.endswith(f", got {value!r}")
    return message


def config(**parts: Any) -> Any:
    content = {
        "labels": {"names": ["corridor", "room"]},
        "train": [{"generated": 1}],
        "methods": [{"name": "independent"}],
    }
    return parse_config(content | parts, "office.toml")


@pytest.mark.parametrize(("table", "name", "value"), table_cases())
def test_a_table_refuses_what_its_class_refuses(table: str, name: str, value: Any) -> None:
    first, _, inner = table.partition(".")
    content = {first: {inner: {name: value}} if inner else {name: value}}
    if isinstance(value, dict) and name == "noise":
        return  # a table: its own keys are looked at
    said = refusal(lambda: config(**content))
    assert said == f"office.toml: {table}.{in_python(TABLES[table], name, value)}"


@pytest.mark.parametrize(("method", "name", "value"), method_cases())
def test_a_method_refuses_alike_in_python_by_name_and_in_a_table(
    method: str, name: str, value: Any
) -> None:
    said = f"method {method!r}: {in_python(METHODS.find(method), name, value)}"
    assert refusal(lambda: build(method, {name: value})) == said
    table = {"name": method, name: value}
    assert refusal(lambda: config(methods=[table])) == f"office.toml: {said}"


@pytest.mark.parametrize(
    ("cls", "name", "value"),
    [(cls, *case) for cls in OTHERS for case in cases(cls) if case[0] != "geometry"],
)
def test_other_classes_refuse_in_python(cls: type[Any], name: str, value: Any) -> None:
    in_python(cls, name, value)


def flag_cases() -> list[Case]:
    """Values that a text can say; text is what an option of text takes."""
    hints = option_hints(TopologyOptions)
    return [
        (name, value)
        for name, value in cases(TopologyOptions)
        if hints[name] not in (bool, str) and isinstance(value, int | float | str)
        if not isinstance(value, bool) and name != "doorways"
    ]


@pytest.mark.parametrize(("name", "value"), flag_cases())
def test_a_flag_refuses_what_its_class_refuses(name: str, value: Any) -> None:
    arguments = ["topology", "labels.png", "map.yaml", "--out", "out", f"{flag_of(name)}={value}"]
    with pytest.raises(ConfigError) as found:
        run(arguments)
    message = in_python(TopologyOptions, name, value)
    assert str(found.value) == message.replace(name, flag_of(name), 1)


@pytest.mark.parametrize(
    ("line", "flag", "value", "cls", "option"),
    [
        ("label map.yaml --out out", "--doorways", "walls", TopologyOptions, "doorways"),
        ("simulate map.yaml --out a.log", "--speed", 0, SimulatedRobot, "speed_m_s"),
        ("simulate map.yaml --out a.log", "--every", 0, SimulatedRobot, "scan_every_s"),
        ("simulate map.yaml --out a.log", "--robot-radius", 0, SimulatedRobot, "radius_m"),
        ("simulate map.yaml --out a.log", "--beams", 0, LaserOptions, "n_beams"),
        ("simulate map.yaml --out a.log", "--view", 0, LaserOptions, "view_degrees"),
        ("simulate map.yaml --out a.log", "--range", 0, LaserOptions, "range_m"),
        ("track drive.log --out out", "--mode", "best", None, "'filter', 'smooth' or 'viterbi', "),
        ("track drive.log --out out", "--beams", "none", None, "'local-map', 'known-map', 'mirr"),
        ("track drive.log --out out", "--every", -1, None, "a number of at least 0, got -1.0"),
    ],
)
def test_flags_refuse_what_the_classes_refuse(
    line: str, flag: str, value: Any, cls: type[Any] | None, option: str
) -> None:
    """The labelers that track have no class of options: what they want is written out."""
    with pytest.raises(ConfigError) as found:
        run([*line.split(), f"{flag}={value}"])
    if cls is None:
        assert str(found.value).startswith(f"{flag} must be {option}")
    else:
        assert str(found.value) == in_python(cls, option, value).replace(option, flag, 1)


def test_a_robot_has_the_laser_that_flags_and_configurations_give_it() -> None:
    robot = SimulatedRobot()
    given = SimulatedRobot.of(RobotMotion(speed_m_s=0.8), LaserOptions(noise_m=0.0))
    assert given.speed_m_s == 0.8
    assert given.radius_m == robot.radius_m
    assert given.sensor_noise is None
    assert given.geometry.range_max_m == robot.geometry.range_max_m
    np.testing.assert_array_equal(given.geometry.angles_rad, robot.geometry.angles_rad)


# ---------------------------------------------------------------------- defaults and words


@pytest.mark.parametrize("cls", [*TABLES.values(), *OTHERS, *map(METHODS.find, BACKENDS)])
def test_defaults_are_among_the_values_that_are_taken(cls: type[Any]) -> None:
    given = option_values(cls())
    assert option_values(from_mapping(cls, given)) == given


@pytest.mark.parametrize("cls", [*TABLES.values(), *OTHERS, *map(METHODS.find, BACKENDS)])
def test_every_option_is_described(cls: type[Any]) -> None:
    missing = [name for name, line in option_lines(cls).items() if not line]
    assert not missing


@pytest.mark.parametrize("name", list(BACKENDS))
def test_the_table_of_methods_lists_every_option(name: str) -> None:
    page = (Path(__file__).parents[1] / "docs" / "configuration.md").read_text(encoding="utf-8")
    lines = [line.strip("|") for line in page.splitlines() if line.startswith("|")]
    table = [[cell.strip() for cell in line.split("|")] for line in lines]
    [head] = [i for i, row in enumerate(table) if "`relaxation`" in row]
    column = table[head].index(f"`{name}`")
    listed = set()
    for row in itertools.takewhile(lambda row: row[0] != "trainable", table[head + 2 :]):
        if row[column]:
            cell = row[column] if row[0] == "specific to the method" else row[0].partition(":")[0]
            listed |= set(re.findall(r"`(\w+)`", cell))
    assert listed == set(option_hints(METHODS.find(name)))


@pytest.mark.parametrize(
    ("hint", "text"),
    [
        (Annotated[int, Ge(3), Le(3600)], "a whole number from 3 to 3600"),
        (Whole, "a whole number of at least 1"),
        (Positive, "a number above 0"),
        (float, "a finite number"),
        (bool, "true or false"),
        (str | None, "a string or None"),
        (Annotated[float, Gt(0), Lt(1)], "a number above 0 and below 1"),
        (Literal["list", "argmax"], "'list' or 'argmax'"),
        (Annotated[tuple[str, ...], MinLen(2)], "a list of at least 2 strings"),
        (tuple[int | None, int | None], "a list of two: a whole number or None"),
        (
            Positive | Literal["auto"] | Annotated[tuple[Positive, ...], MinLen(1)],
            "a number above 0, 'auto', or a non-empty list of numbers above 0",
        ),
        (SensorNoise | None, "a table of options (SensorNoise) or None"),
        (dict[str, Any], "a table"),
        (Mapping[str, Positive], "a table"),
    ],
)
def test_what_is_wanted_in_words(hint: Any, text: str) -> None:
    assert describe_type(hint) == text


# ---------------------------------------------------------------------- the machinery


@dataclasses.dataclass(frozen=True)
class Inner:
    """A table in a table.

    Parameters
    ----------
    size_m : float
        How big. And more.
    """

    size_m: AtLeastZero = 1.0

    def __post_init__(self) -> None:
        check_options(self)


@dataclasses.dataclass(frozen=True)
class Outer:
    """Options of all kinds.

    Parameters
    ----------
    name : str
        What to call it.
    parts : list of Inner
        What it is made of,
        line by line.
    counts, weights : list
        Lists.
    """

    name: str
    parts: tuple[Inner, ...] = ()
    counts: list[int] = dataclasses.field(default_factory=list)
    weights: tuple[float, ...] = ()
    reach_m: AtLeastZeroOrInfinite = 1.0

    def __post_init__(self) -> None:
        check_options(self)


def test_tables_become_objects_all_the_way_down() -> None:
    found = from_mapping(Outer, {"name": "a", "parts": [{"size_m": 2}, {}], "weights": [1, 2.5]})
    assert found == Outer("a", (Inner(2.0), Inner()), [], (1.0, 2.5))
    assert plain_values(found) == {
        "name": "a",
        "parts": [{"size_m": 2.0}, {"size_m": 1.0}],
        "counts": [],
        "weights": [1.0, 2.5],
        "reach_m": 1.0,
    }


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "'top.name' is missing"),
        ({"name": "a", "part": []}, "unknown key 'top.part'. Did you mean 'parts'?"),
        ({"name": "a", "parts": [{}, {"size": 1}]}, "unknown key 'top.parts[1].size'. Did you"),
        ({"name": "a", "parts": [{"size_m": -1}]}, "top.parts[0].size_m must be a number of at"),
        ({"name": 3}, "top.name must be a string, got 3"),
        ({"name": "a", "counts": [1, "2"]}, "top.counts must be a list of whole numbers, got [1,"),
    ],
)
def test_a_table_that_does_not_fit_is_named_by_its_place(
    table: dict[str, Any], message: str
) -> None:
    assert refusal(lambda: from_mapping(Outer, table, path="top")).startswith(message)


def test_numbers_of_numpy_are_numbers() -> None:
    sensor = Sensor(np.int64(36), np.float32(2.5))  # type: ignore[arg-type]
    assert type(sensor.n_beams) is int
    assert type(sensor.max_range_m) is float
    assert sensor == Sensor(36, 2.5)


def test_only_marked_numbers_may_be_infinite() -> None:
    assert Outer("a", reach_m=math.inf).reach_m == math.inf
    assert "got inf" in refusal(lambda: Inner(math.inf))
    assert "got nan" in refusal(lambda: Outer("a", reach_m=math.nan))


@pytest.mark.parametrize("hint", [Annotated[int, TheirLe(2)], Annotated[int, Interval(gt=0, le=2)]])
def test_limits_of_annotated_types_are_obeyed_and_told(hint: Any) -> None:
    assert check_option("n", hint, 2) == 2
    with pytest.raises(OptionError, match=r"n must be a whole number .*at most 2, got 3"):
        check_option("n", hint, 3)


def test_marks_that_cannot_be_checked_are_no_silent_leave() -> None:
    with pytest.raises(TypeError, match="options know no mark Predicate"):
        check_option("n", Annotated[int, Predicate(bool)], 3)


def test_annotations_for_type_checkers_only_are_passed_over() -> None:
    fields = [("n", "OnlyForTypeCheckers", dataclasses.field(default=1))]
    foreign = dataclasses.make_dataclass("Foreign", fields, frozen=True)
    assert option_hints(foreign) == {"n": Any}
    assert option_values(from_mapping(foreign, {"n": "x"})) == {"n": "x"}


def test_the_first_sentence_describes_an_option() -> None:
    assert option_lines(Inner) == {"size_m": "How big."}
    lines = option_lines(Outer)
    assert lines["parts"] == "What it is made of, line by line."
    assert lines["counts"] == lines["weights"] == "Lists."
    assert option_lines(TopologyOptions)["min_area_m2"].startswith("Minimum area of a room")


def test_flags_are_made_from_options() -> None:
    command = option_flags("rules", TopologyOptions, {"doorway_label": "--doorway"})(_command)
    shown = inspect.signature(command).parameters
    assert list(shown) == ["path", *option_hints(TopologyOptions), "quiet"]
    assert shown["min_area_m2"].default == "1.0"
    assert shown["correct"].default is True
    given = {name: item.default for name, item in shown.items() if name != "path"}
    command(path="x", **given | {"min_area_m2": "2", "doorway_label": "5", "correct": False})
    assert _called["rules"] == TopologyOptions(min_area_m2=2.0, doorway_label="5", correct=False)
    with pytest.raises(OptionError, match=re.escape("--min-width must be a number of at least 0")):
        command(path="x", **given | {"min_width_m": "-0.5"})


def test_flags_that_are_not_given_leave_what_others_say() -> None:
    command = option_flags("rules", TopologyOptions, only_given=True)(_command)
    shown = inspect.signature(command).parameters
    given = {name: item.default for name, item in shown.items() if name != "path"}
    assert set(given.values()) == {None, False}
    command(path="x", **given | {"min_area_m2": "1", "correct": True})
    stored = TopologyOptions(min_area_m2=3.0, min_width_m=0.3, correct=False)
    assert _called["rules"].applied_to(stored) == TopologyOptions(min_width_m=0.3)
    with pytest.raises(OptionError, match=re.escape("--min-width must be a number of at least 0")):
        command(path="x", **given | {"min_width_m": "-0.5"})


_called: dict[str, Any] = {}


def _command(path: str, *, rules: Any, quiet: bool = False) -> None:
    _called.update(path=path, rules=rules, quiet=quiet)


def test_the_command_line_starts_without_numpy() -> None:
    code = (
        "import sys\n"
        "from pgm_places.cli.app import run\n"
        "run([])\n"
        "print(*{'numpy'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == ""


def test_a_real_table_of_toml_is_read_alike() -> None:
    text = "[sensor]\nn_beams = 2"
    said = refusal(lambda: config(**tomllib.loads(text)))
    assert said == "office.toml: sensor.n_beams must be a whole number from 3 to 3600, got 2"


@pytest.mark.parametrize(
    ("hint", "value", "taken"),
    [
        (float, 1, 1.0),
        (float, np.float32(0.5), 0.5),
        (float, 10**400, None),
        (float, True, None),
        (float, math.nan, None),
        (AtLeastZeroOrInfinite, math.inf, math.inf),
        (AtLeastZeroOrInfinite, math.nan, None),
        (AtLeastZeroOrInfinite, -math.inf, None),
        (int, True, None),
        (int, 1.0, None),
        (int, 10**30, 10**30),
        (bool, np.bool_(True), True),
        (bool, 1, None),
        (str, 3, None),
        (Literal[4, 8], 8.0, None),
        (Literal[1, 8], True, None),
        (Positive | Literal["auto"], "auto", "auto"),
        (Positive | Literal["auto"], 1, 1.0),
        (tuple[float, ...], [1, 2], (1.0, 2.0)),
        (tuple[int, int], [1, 2, 3], None),
        (tuple[int, int], "12", None),
        (list[int], (1, 2), [1, 2]),
        (list[int], np.array([1, 2]), None),
        (tuple[tuple[int, str], ...], [[1, "a"], [2, "b"]], ((1, "a"), (2, "b"))),
        (tuple[tuple[int, str], ...], [[1, 2]], None),
        (Annotated[tuple[str, ...], MinLen(1)], [], None),
        (dict[str, Any], {"a": [1]}, {"a": [1]}),
        (Mapping[str, Positive], {"a": 2}, {"a": 2.0}),
        (Mapping[str, Positive], {"a": 0}, None),
        (Mapping[str, Positive], {1: 2.0}, None),
    ],
)
def test_a_value_is_taken_as_it_is_declared_or_refused(hint: Any, value: Any, taken: Any) -> None:
    if taken is None:
        with pytest.raises(OptionError, match="n must be "):
            check_option("n", hint, value)
    else:
        assert repr(check_option("n", hint, value)) == repr(taken)
