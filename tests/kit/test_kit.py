"""Small pieces of the kit: timelines, positions, figures, and the registry of lessons."""

from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lessons import registry as registry_module
from lessons.kit import figures
from lessons.kit.lesson import Cancelled, Lesson, Moment, Timeline, no_progress
from lessons.kit.scene import points3
from lessons.registry import CHAPTER_NAMES, CHAPTERS, Entry, Registry
from tests.app import sample_lessons

# -- timelines ------------------------------------------------------------------------------------------------------


@given(st.integers(0, 50), st.integers(1, 5), st.integers(-(10**9), 10**9), st.integers(-10, 10))
def test_clamp_gives_a_moment_of_the_timeline(steps, stages, step, stage):
    timeline = Timeline(steps, tuple("abcde"[:stages]))
    moment = timeline.clamp(step, stage)
    assert 0 <= moment.step <= steps and 0 <= moment.stage < stages
    assert timeline.clamp(moment.step, moment.stage) == moment
    if 0 <= step <= steps and 0 <= stage < stages:
        assert moment == Moment(step, stage)
    if stage < 0:
        assert moment.stage == stages - 1


def test_the_first_moment():
    assert Timeline(10, ("a", "b"), start=4).first_shown == Moment(4, 1)
    assert Timeline(10, ("a", "b"), start=99, start_stage=0).first_shown == Moment(10, 0)
    assert Timeline(0).first_shown == Moment(0, 0)


def test_a_still_picture_has_one_moment():
    lesson = Lesson(object, lambda p, progress: None, lambda p, r, at: None)
    assert lesson.timeline_of(None) == Timeline(0) and not lesson.unused_at(None)
    assert no_progress(0.5) is None and issubclass(Cancelled, Exception)


# -- scene ----------------------------------------------------------------------------------------------------------


def test_positions_in_the_plane_lie_at_zero():
    np.testing.assert_array_equal(points3([(1, 2), (3, 4)]), [(1, 2, 0), (3, 4, 0)])
    np.testing.assert_array_equal(points3(np.eye(3)), np.eye(3))
    assert points3(np.zeros((0, 2))).shape == (0, 3)
    flat = np.array([[1.0, 2.0]])
    points3(flat)[0, 0] = 9.0
    assert flat[0, 0] == 1.0


@pytest.mark.parametrize("wrong", [[1.0, 2.0], np.zeros((2, 4)), np.zeros((2, 1)), np.zeros((1, 2, 2)), 5.0, []])
def test_other_shapes_are_refused(wrong):
    with pytest.raises(ValueError, match=r"expected shape \(n, 2\) or \(n, 3\), got"):
        points3(wrong)


# -- figures --------------------------------------------------------------------------------------------------------

X = np.linspace(0.1, 1.0, 4)


def test_traces_carry_their_key_and_role():
    made = {"line": figures.line("a", X, X, "ekf"), "markers": figures.markers("a", X, X, "ekf"),
            "band": figures.band("a", X, -X, X, "ekf"), "bars": figures.bars("a", X, X, "ekf")}
    for trace in made.values():
        assert trace.meta["key"] == "a" and trace.meta["role"] == "ekf"
    assert made["line"].mode == "lines" and made["markers"].mode == "markers" and made["bars"].type == "bar"
    assert figures.line("a", X, X, "ekf", dash=True, markers=True).mode == "lines+markers"
    assert figures.line("a", X, X, "ekf", dash=True).line.dash == "dash"
    assert made["line"].line.color is None       # the app gives it the theme's
    np.testing.assert_array_equal(figures.line("a", [1, 2], (3, 4), "ekf").y, [3.0, 4.0])


def test_a_band_goes_there_and_back():
    band = figures.band("a", [0, 1, 2], [-1, -2, -3], [1, 2, 3], "ekf")
    np.testing.assert_array_equal(band.x, [0, 1, 2, 2, 1, 0])
    np.testing.assert_array_equal(band.y, [-1, -2, -3, 3, 2, 1])
    assert band.fill == "toself" and band.meta["fill"]


def test_charts():
    chart = figures.chart(figures.line("a", X, X, "ekf"), cursor=0.5, marks=(0.2, 0.3), log_x=True, x_range=(0.1, 10.0),
                          y_range=(0.0, 2.0), equal=True)
    assert chart.layout.xaxis.type == "log" and chart.layout.xaxis.range == (-1.0, 1.0)
    assert chart.layout.yaxis.type == "linear" and chart.layout.yaxis.range == (0.0, 2.0)
    assert chart.layout.yaxis.scaleanchor == "x"
    assert [(s.name, s.x0) for s in chart.layout.shapes] == [("mark", 0.2), ("mark", 0.3), ("cursor", 0.5)]
    assert figures.chart(figures.bars("a", [0, 1], X[:2], "pf"), categories=True).layout.xaxis.type == "category"


# -- registry -------------------------------------------------------------------------------------------------------


def test_our_own_lessons_in_teaching_order():
    found = [entry.id for entry in Registry()]
    own = [f"{chapter}.{name}" for chapter, names in CHAPTERS.items() for name in names]
    assert found[:len(own)] == own and len(set(found)) == len(found)
    assert Registry().first.id == own[0] and own[0] in Registry()
    assert list(Registry().chapters()) == [chapter for chapter, names in CHAPTERS.items() if names]
    for names in CHAPTER_NAMES.values():
        assert set(names) == set(CHAPTERS)


def test_every_lesson_module_is_listed():
    """A module that nobody lists would never be seen."""
    root = Path(registry_module.__file__).parent
    modules = {f"{path.parent.name}.{path.stem}" for path in root.glob("*/*.py")
               if not path.name.startswith("_") and path.parent.name != "kit"}
    assert modules == {f"{chapter}.{name}" for chapter, names in CHAPTERS.items() for name in names}


@pytest.mark.parametrize("entry", list(Registry()), ids=lambda entry: entry.id)
def test_every_listed_lesson_exists(entry):
    assert isinstance(entry.lesson, Lesson) and entry.words().title
    assert entry.chapter == entry.id.split(".")[0]


def test_an_unknown_lesson_names_the_closest():
    with pytest.raises(KeyError, match=r"unknown lesson 'kalman'; did you mean filtering\.kalman"):
        Registry()["kalman"]
    with pytest.raises(KeyError, match="paikka list"):
        Registry()["#"]


def test_lessons_of_a_folder(tmp_path):
    folder = sample_lessons.write(tmp_path / "course", "quick", "slow")
    sample_lessons.write(tmp_path / "course" / "week2", "fragile")
    (folder / "_helper.py").write_text("", encoding="utf-8")
    (folder / "notes.txt").write_text("", encoding="utf-8")
    registry = Registry(folder)
    assert [entry.id for entry in registry][-3:] == ["course.quick", "course.slow", "week2.fragile"]
    assert registry["course.quick"].lesson.presets and registry["course.quick"].words().title == "A quick wave"
    assert list(registry["week2.fragile"].parameters) == ["target", "broken"]
    assert registry["course.quick"].module is registry["course.quick"].module


def test_a_folder_without_lessons_is_an_error(tmp_path):
    with pytest.raises(ValueError, match=r"expected lessons .* found none"):
        Registry(tmp_path)
    with pytest.raises(ValueError, match=r"expected a folder with lessons, got .*missing"):
        Registry(tmp_path / "missing")


def test_a_folder_that_is_named_by_a_dot(tmp_path, monkeypatch):
    sample_lessons.write(tmp_path / "course", "quick")
    monkeypatch.chdir(tmp_path / "course")
    assert "course.quick" in Registry(Path("."))


def test_a_file_that_is_no_lesson(tmp_path):
    (tmp_path / "plain.py").write_text("LESSON = 5\n", encoding="utf-8")
    entry = next(entry for entry in Registry(tmp_path) if entry.id.endswith(".plain"))
    with pytest.raises(ValueError, match=r"plain: expected a module with LESSON = Lesson\(\.\.\.\), got int"):
        _ = entry.lesson


def test_lessons_of_installed_packages(monkeypatch):
    point = EntryPoint("static.extra", "lessons.filtering.kalman", "paikka.lessons")
    monkeypatch.setattr(registry_module.importlib.metadata, "entry_points",
                        lambda group: [point] if group == "paikka.lessons" else [])
    assert Registry()["static.extra"] == Entry("static.extra", "lessons.filtering.kalman")
    assert "static" in Registry().chapters() and Registry()["static.extra"].lesson
