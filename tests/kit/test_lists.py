"""Lists of points, lists of names, and files as parameters."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lessons.kit import files
from lessons.kit.parameter import FileKind, Parameter
from tests.kit.test_params import anything

properties = settings(deadline=None, max_examples=100)
NOTE = FileKind("a note", (".note",), lambda content: content.startswith(b"NOTE"), lambda content: None)
POINTS = Parameter("fixes", "points", ((1.0, 2.0),), -10.0, 10.0, limit=4)
NAMES = Parameter("route", "names", ("a",), limit=4)
FILE = Parameter("note", "file", "", file=NOTE)
every = pytest.mark.parametrize("parameter", (POINTS, NAMES, FILE), ids=lambda p: p.name)

numbers = st.floats(-10.0, 10.0)
points = st.lists(st.tuples(numbers, numbers), max_size=4).map(tuple)
names = st.lists(st.from_regex(r"[A-Za-z0-9_.\-]{1,32}", fullmatch=True), max_size=4).map(tuple)


@properties
@given(points)
def test_points_are_written_and_read_back(value):
    assert POINTS.validate(POINTS.parse(POINTS.format(value))) == value


@properties
@given(names)
def test_names_are_written_and_read_back(value):
    assert NAMES.validate(NAMES.parse(NAMES.format(value))) == value


@every
@properties
@given(value=anything)
def test_anything_is_valid_or_refused_in_words(parameter, value):
    try:
        found = parameter.validate(value)
    except ValueError as error:
        assert str(error).startswith(f"{parameter.name}: expected ")
    else:
        assert parameter.validate(found) == found
        hash(found)
    assert parameter.validate(parameter.nearest(value)) == parameter.nearest(value)


@pytest.mark.parametrize("value", [((1.0, 2.0, 3.0),), ((1.0,),), ((11.0, 0.0),), ((0.0, 0.0),) * 5, "1,2", (1.0, 2.0),
                                   ((float("nan"), 0.0),)])
def test_wrong_points(value):
    with pytest.raises(ValueError, match="fixes: expected"):
        POINTS.validate(value)


@pytest.mark.parametrize("value", [("",), ("a b",), ("x" * 33,), ("a",) * 5, "abc", (1,), ("<b>",)])
def test_wrong_names(value):
    with pytest.raises(ValueError, match="route: expected at most 4 names"):
        NAMES.validate(value)


def test_the_nearest_points_lie_within_the_limits():
    assert POINTS.nearest(((99.0, -99.0), (0.0, 1.0))) == ((10.0, -10.0), (0.0, 1.0))
    assert len(POINTS.nearest(((0.0, 0.0),) * 9)) == 4
    with pytest.raises(ValueError, match="expected at most 4 points"):
        POINTS.parse("1,2;3,x")


def test_a_file_must_be_here_and_of_the_right_kind():
    key, other = files.put("a.note", b"NOTE a"), files.put("b.txt", b"text")
    assert FILE.validate(key) == key and FILE.validate("") == ""
    for value in (other, "0" * 16, "zzz", None, 7):
        with pytest.raises(ValueError, match="note: expected a note that this server has been given"):
            FILE.validate(value)
    assert FILE.nearest("0" * 16) == ""
