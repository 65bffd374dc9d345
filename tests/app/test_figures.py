"""Plots: the theme's colours, the words' names, no cloud, and only what changed goes to the client."""

import json
import re
from types import TracebackType
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from app.export import figure_file
from app.figure_renderer import CONFIG, FigureRenderer, themed
from app.theme import DARK, LIGHT, THEMES, css
from lessons.kit import figures
from lessons.kit.roles import ROLES
from lessons.kit.words import parse

X = np.linspace(0.0, 1.0, 5)
WORDS = parse("""---
figures:
  error: {title: Error of the mean, x: "time t (s)", y: "error (m)", traces: {ekf: "extended <filter>"}}
  hist: {title: Histogram, x: "x (m)", y: "share (%)"}
---
""")


def chart() -> go.Figure:
    return figures.chart(
        figures.line("ekf", X, X**2, "ekf", width=3.0), figures.markers("y", X, X, "measurement", size=8),
        figures.band("sigma", X, -X, X, "posterior"), figures.bars("w", X, X, "pf"), cursor=0.5, marks=(0.25, 0.75))


def ready(theme: Any = LIGHT, name: str = "error", **options: Any) -> go.Figure:
    """The themed figure as plotly itself reads it: a property it does not know is an error."""
    return go.Figure(themed(chart(), name, WORDS, theme, **options))


@pytest.mark.parametrize("theme", THEMES.values(), ids=list(THEMES))
def test_traces_have_the_colours_of_their_roles(theme):
    line, dots, band, bars = ready(theme).data
    assert line.line.color == css(theme.color("ekf"))
    assert dots.marker.color == css(theme.color("measurement"))
    assert bars.marker.color == css(theme.color("pf"))
    assert band.fillcolor == css(theme.color("posterior"), 0.18) and band.line.color == "rgba(0,0,0,0)"


@pytest.mark.parametrize("theme", THEMES.values(), ids=list(THEMES))
@pytest.mark.parametrize("role", ROLES)
def test_every_role_has_a_colour_in_plots(theme, role):
    figure = themed(figures.chart(figures.line("k", X, X, role)), "error", WORDS, theme)
    assert go.Figure(figure).data[0].line.color == css(theme.color(role))


@pytest.mark.parametrize("theme", THEMES.values(), ids=list(THEMES))
def test_text_and_grid_are_the_theme_s(theme):
    layout = ready(theme).layout
    assert layout.font.color == css(theme.text)
    assert layout.xaxis.gridcolor == layout.yaxis.gridcolor == css(theme.grid)
    assert layout.paper_bgcolor == layout.plot_bgcolor == "rgba(0,0,0,0)"
    colors = [shape.line.color for shape in layout.shapes]
    assert colors == [css(theme.color("reference"))] * 2 + [css(theme.color("warning"))]


def test_no_colour_of_the_other_theme_is_left():
    text = json.dumps(ready(DARK).to_plotly_json(), default=str)
    for role in ("ekf", "measurement", "pf", "warning", "muted"):
        assert css(LIGHT.color(role)) != css(DARK.color(role)) and css(LIGHT.color(role)) not in text


def test_names_come_from_the_words_and_else_from_the_role():
    figure = ready()
    assert figure.layout.xaxis.title.text == "time t (s)" and figure.layout.yaxis.title.text == "error (m)"
    assert [trace.name for trace in figure.data] == ["extended <filter>", "measurement", "posterior", "particle filter"]
    assert figure.layout.title.text is None      # on the screen the tab says it
    assert ready(titled=True).layout.title.text == "Error of the mean"
    assert ready(name="hist").layout.yaxis.title.text == "share (%)"


def test_the_lesson_s_figure_is_not_changed():
    figure = chart()
    before = figure.to_json()
    themed(figure, "error", WORDS, LIGHT)
    themed(figure, "error", WORDS, DARK, size=2.0, titled=True)
    assert figure.to_json() == before


def test_a_larger_picture_has_larger_text_and_lines():
    plain, large = ready(), ready(size=2.0)
    for get in (lambda f: f.layout.font.size, lambda f: f.layout.xaxis.title.font.size, lambda f: f.data[0].line.width,
                lambda f: f.data[1].marker.size, lambda f: f.layout.shapes[0].line.width,
                lambda f: f.layout.legend.font.size):
        assert get(large) == pytest.approx(2 * get(plain))


def test_one_trace_needs_no_legend():
    assert ready().layout.showlegend is True
    alone = figures.chart(figures.line("ekf", X, X, "ekf"))
    assert go.Figure(themed(alone, "error", WORDS, LIGHT)).layout.showlegend is False


def test_ranges_and_logarithmic_axes_survive():
    figure = figures.chart(figures.line("ekf", X, X, "ekf"), log_x=True, x_range=(0.1, 1000.0), y_range=(-1.0, 2.0))
    layout = go.Figure(themed(figure, "error", WORDS, LIGHT)).layout
    assert layout.xaxis.type == "log" and layout.xaxis.range == (-1.0, 3.0)
    assert layout.yaxis.type == "linear" and layout.yaxis.range == (-1.0, 2.0)


def test_nothing_leaves_for_the_cloud_and_pictures_are_svg():
    assert "sendChartToCloud" in CONFIG["modeBarButtonsToRemove"] and CONFIG["showSendToCloud"] is False
    assert CONFIG["plotlyServerURL"] == "" and CONFIG["displaylogo"] is False
    assert CONFIG["toImageButtonOptions"]["format"] == "svg"


def test_an_html_file_is_complete(tmp_path):
    path = tmp_path / "error.html"
    figure_file.write(ready(), path, (600, 400))
    text = path.read_text(encoding="utf-8")
    assert "time t (s)" in text and '"displaylogo": false' in text.replace('":false', '": false')
    assert not re.search(r"<(script|link)[^>]+(src|href)=", text)    # the library is inside


# -- the renderer ---------------------------------------------------------------------------------------------------


class Tab:
    def __init__(self, log: list[Any], label: str) -> None:
        self.log, self.label = log, label

    def __enter__(self) -> "Tab":
        self.log.append(("enter", self.label))
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.log.append(("exit", self.label))

    def remove(self) -> None:
        self.log.append(("remove", self.label))


class Plot:
    """Whatever is assigned to it is a message to the client."""

    def __init__(self, log: list[Any], number: int) -> None:
        object.__setattr__(self, "log", log)
        object.__setattr__(self, "number", number)

    def __setattr__(self, key: str, value: Any) -> None:
        object.__setattr__(self, key, value)
        self.log.append(("show", self.number))


class Gui:
    """The parts of a gui and of a panel that the renderer may use."""

    def __init__(self) -> None:
        self.log: list[Any] = []
        self.plots: list[Plot] = []
        self.visible = True

    def add_tab(self, label: str) -> Tab:
        self.log.append(("tab", label))
        return Tab(self.log, label)

    def add_plotly(self, figure: go.Figure, **options: Any) -> Plot:
        self.log.append(("plot", len(self.plots)))
        self.plots.append(Plot(self.log, len(self.plots)))
        return self.plots[-1]

    def take(self) -> list[Any]:
        found = list(self.log)
        self.log.clear()
        return found

    def sent(self, number: int) -> dict[str, Any]:
        return json.loads(self.plots[number]._plotly_json_str)


@pytest.fixture
def gui() -> Gui:
    return Gui()


@pytest.fixture
def renderer(gui: Gui) -> FigureRenderer:
    return FigureRenderer(gui, gui)


def two(value: float = 1.0) -> dict[str, go.Figure]:
    return {"error": figures.chart(figures.line("ekf", X, value * X, "ekf")),
            "hist": figures.chart(figures.bars("w", X, X, "pf"))}


def test_each_figure_gets_a_tab_with_its_title(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    assert gui.visible
    assert gui.take() == [("tab", "Error of the mean"), ("enter", "Error of the mean"), ("plot", 0),
                          ("exit", "Error of the mean"), ("show", 0),
                          ("tab", "Histogram"), ("enter", "Histogram"), ("plot", 1), ("exit", "Histogram"), ("show", 1)]
    sent = gui.sent(0)
    assert sent["config"] == CONFIG
    assert sent["layout"]["xaxis"]["title"]["text"] == "time t (s)"
    assert sent["data"][0]["line"]["color"] == css(LIGHT.color("ekf"))


def test_an_identical_view_sends_nothing(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    gui.take()
    renderer.render(two(), WORDS, LIGHT)
    assert gui.take() == []


def test_only_the_figure_that_changed_is_sent(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    gui.take()
    renderer.render(two(2.0), WORDS, LIGHT)
    assert gui.take() == [("show", 0)]


def test_the_other_theme_sends_all_in_the_same_tabs(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    gui.take()
    renderer.render(two(), WORDS, DARK)
    assert gui.take() == [("show", 0), ("show", 1)]
    assert gui.sent(1)["data"][0]["marker"]["color"] == css(DARK.color("pf"))


def test_other_figures_replace_the_tabs(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    gui.take()
    renderer.render({"hist": two()["hist"]}, WORDS, LIGHT)
    calls = gui.take()
    assert calls[:2] == [("remove", "Error of the mean"), ("remove", "Histogram")]
    assert [call for call in calls if call[0] in ("tab", "show")] == [("tab", "Histogram"), ("show", 2)]


def test_without_figures_the_panel_hides(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    renderer.render({}, WORDS, LIGHT)
    assert gui.visible is False
    assert [call for call in gui.take() if call[0] == "remove"] == [("remove", "Error of the mean"),
                                                                   ("remove", "Histogram")]
    renderer.render(two(), WORDS, LIGHT)
    assert gui.visible is True and ("show", 2) in gui.take()


def test_clear_forgets_what_was_shown(renderer, gui):
    renderer.render(two(), WORDS, LIGHT)
    renderer.clear()
    gui.take()
    renderer.render(two(), WORDS, LIGHT)
    assert ("show", 2) in gui.take()
