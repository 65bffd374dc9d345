"""Parameters: what is valid, what is nearest, and that text and value are two forms of the same thing."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lessons.kit.params import SEED_LIMIT, Parameter, choice, draggable, parameters, seed, slider, switch, values

properties = settings(deadline=None, max_examples=150)

FLOAT = Parameter("gain", "float", 1.0, -2.0, 8.0)
INT = Parameter("runs", "int", 5, 1, 100_000)
POINT = Parameter("place", "point", (1.0, 2.0), -10.0, 10.0)
SPACE = Parameter("axis", "point", (0.0, 0.0, 1.0), -3.0, 3.0)
SWITCH = Parameter("on", "switch", False)
CHOICE = Parameter("map", "choice", "polar", options=("polar", "two ranges", "x&y=z"))
SEED = Parameter("seed", "seed", 1, 0, SEED_LIMIT)
ALL = (FLOAT, INT, POINT, SPACE, SWITCH, CHOICE, SEED)
every = pytest.mark.parametrize("parameter", ALL, ids=lambda p: p.name)

anything = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.binary(max_size=4),
    st.lists(st.floats() | st.integers() | st.text(max_size=2), max_size=4),
    st.tuples(st.floats(), st.floats()), st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
    st.just(10**400), st.just(-(10**400)), st.complex_numbers(), st.just(np.array([1.0, 2.0])),
    st.just(np.float32(2.5)),
)


def is_valid(p: Parameter, value: Any) -> bool:
    match p.kind:
        case "switch":
            return isinstance(value, bool)
        case "choice":
            return value in p.options
        case "point":
            return isinstance(value, tuple) and len(value) == len(p.default) and all(
                isinstance(v, float) and p.low <= v <= p.high for v in value)
        case "int" | "seed":
            return type(value) is int and p.low <= value <= p.high
        case _:
            return type(value) is float and p.low <= value <= p.high


def valid_values(p: Parameter) -> st.SearchStrategy[Any]:
    match p.kind:
        case "switch":
            return st.booleans()
        case "choice":
            return st.sampled_from(p.options)
        case "point":
            return st.tuples(*[st.floats(p.low, p.high)] * len(p.default))
        case "int" | "seed":
            return st.integers(int(p.low), int(p.high))
        case _:
            return st.floats(p.low, p.high)


@every
@properties
@given(data=st.data())
def test_text_and_value_are_the_same(parameter, data):
    value = data.draw(valid_values(parameter))
    assert parameter.validate(value) == value
    text = parameter.format(value)
    assert parameter.validate(parameter.parse(text)) == value
    assert " " not in text or parameter.kind == "choice"


@every
@properties
@given(value=anything)
def test_validate_gives_a_valid_value_or_says_what_is_expected(parameter, value):
    try:
        found = parameter.validate(value)
    except ValueError as error:
        text = str(error)
        assert text.startswith(f"{parameter.name}: expected ") and ", got " in text and len(text) < 250
    else:
        assert is_valid(parameter, found)


@every
@properties
@given(value=anything)
def test_nearest_is_always_valid_and_keeps_what_is_valid(parameter, value):
    found = parameter.nearest(value)
    assert is_valid(parameter, found)
    assert parameter.nearest(found) == found


@every
@properties
@given(text=st.text(max_size=30))
def test_any_text_is_read_or_refused_with_a_sentence(parameter, text):
    try:
        value = parameter.parse(text)
    except ValueError as error:
        assert str(error).startswith(f"{parameter.name}: expected ") and len(str(error)) < 250
    else:
        assert is_valid(parameter, parameter.nearest(value))


@pytest.mark.parametrize(("parameter", "value", "nearest"), [
    (FLOAT, 9.0, 8.0), (FLOAT, -math.inf, -2.0), (FLOAT, math.nan, 1.0), (FLOAT, 3, 3.0), (FLOAT, "3", 1.0),
    (FLOAT, 10**400, 8.0), (FLOAT, True, 1.0), (INT, 2.4, 2), (INT, 0, 1), (INT, math.inf, 100_000), (INT, None, 5),
    (POINT, [99, -1], (10.0, -1.0)), (POINT, (1.0,), (1.0, 2.0)), (POINT, (1.0, math.nan), (1.0, 2.0)),
    (POINT, "ab", (1.0, 2.0)), (SWITCH, 1, False), (CHOICE, "Polar", "polar"), (CHOICE, ["polar"], "polar"),
    (SEED, -5, 0), (SEED, 2**40, SEED_LIMIT),
])
def test_nearest(parameter, value, nearest):
    found = parameter.nearest(value)
    assert found == nearest and type(found) is type(nearest)


@pytest.mark.parametrize(("parameter", "value", "text"), [
    (FLOAT, 1.0, "1"), (FLOAT, 0.1, "0.1"), (FLOAT, -1.5e-7, "-1.5e-07"), (INT, 1000, "1000"),
    (POINT, (1.0, -2.5), "1,-2.5"),
    (SWITCH, True, "1"), (CHOICE, "x&y=z", "x&y=z"),
])
def test_short_text(parameter, value, text):
    assert parameter.format(value) == text


def test_expected_says_what_would_be_right():
    assert FLOAT.expected == "a number from -2 to 8" and INT.expected == "a whole number from 1 to 100000"
    assert POINT.expected == "2 numbers from -10 to 10" and SWITCH.expected == "1 or 0"
    assert CHOICE.expected == "one of polar, two ranges, x&y=z"


# -- dataclasses ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Params:
    kappa: float = slider(1.0, low=-1.9, high=8.0, step=0.1, group="shape")
    runs: int = slider(100, low=1, high=10_000, log=True, unit="runs")
    mean: tuple[float, ...] = draggable((60, 20), role="prior")
    axis: tuple[float, ...] = draggable((0.0, 0.0, 1.0), plane="sphere", unit="")
    which: str = choice("a", ("a", "b"))
    shown: bool = switch(True)
    seed: int = seed(7)


def test_fields_become_parameters_in_order():
    found = parameters(Params)
    assert list(found) == ["kappa", "runs", "mean", "axis", "which", "shown", "seed"]
    assert [p.kind for p in found.values()] == ["float", "int", "point", "point", "choice", "switch", "seed"]
    kappa = found["kappa"]
    assert (kappa.low, kappa.high, kappa.step, kappa.group) == (-1.9, 8.0, 0.1, "shape")
    assert found["runs"].log and found["runs"].unit == "runs"
    assert found["mean"].default == (60.0, 20.0) and found["mean"].role == "prior" and found["mean"].plane == "xy"
    assert found["axis"].plane == "sphere" and found["which"].options == ("a", "b")
    assert (found["seed"].low, found["seed"].high) == (0, SEED_LIMIT)
    assert parameters(Params) is found


def test_values():
    assert values(Params(kappa=2.0)) == {"kappa": 2.0, "runs": 100, "mean": (60.0, 20.0), "axis": (0.0, 0.0, 1.0),
                                         "which": "a", "shown": True, "seed": 7}
    assert hash(Params()) == hash(Params())      # a key of the cache


def test_a_wrong_definition_is_found_at_once():
    with pytest.raises(ValueError, match="low > 0"):
        slider(1.0, low=0.0, high=10.0, log=True)

    @dataclass(frozen=True)
    class Outside:
        gain: float = slider(11.0, low=0.0, high=10.0)

    with pytest.raises(ValueError, match=r"gain: expected a number from 0 to 10, got 11"):
        parameters(Outside)

    @dataclass(frozen=True)
    class Unlisted:
        which: str = choice("c", ("a", "b"))

    with pytest.raises(ValueError, match="which: expected one of a, b"):
        parameters(Unlisted)

    @dataclass(frozen=True)
    class Bare:
        gain: float = 1.0

    with pytest.raises(TypeError, match=r"Bare\.gain"):
        parameters(Bare)
