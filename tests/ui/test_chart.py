"""Charts: round ticks, lines that stay in their box, points that tell their numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPointF
from PySide6.QtGui import QImage

from app.ui.axis import Axis
from app.ui.chart import Chart, Series
from app.ui.palette import THEMES
from app.ui.series import Legend, series_colour, series_pen


@given(st.floats(1e-6, 1e9), st.integers(1, 8))
def test_ticks_are_few_round_and_inside(high, most):
    axis = Axis("x").holding([high])
    ticks = [value for value, _ in axis.ticks(most)]
    assert 1 <= len(ticks) <= most + 1
    assert all(axis.low - 1e-9 <= t <= axis.high * (1 + 1e-9) for t in ticks)
    assert np.allclose(np.diff(ticks), np.diff(ticks)[:1]) if len(ticks) > 2 else True


@given(st.lists(st.floats(1e-5, 1e7), min_size=1, max_size=9))
def test_a_logarithmic_axis_holds_what_it_shows(values):
    axis = Axis("t", log=True).holding(values)
    for value in values:
        assert -1e-9 <= axis.share(value) <= 1 + 1e-9
    powers = [math.log10(v) for v, _ in axis.ticks()]
    assert powers == pytest.approx([round(p) for p in powers])


def test_what_cannot_be_shown_on_an_axis():
    axis = Axis("t", log=True).holding([0.0, -3.0, math.nan])
    assert (axis.low, axis.high) == (0.0, 1.0)
    assert math.isnan(Axis("t", 1, 10, log=True).share(-1.0))
    fixed = Axis("success", 0, 1, fixed=True, unit="%", scale=100)
    assert fixed.holding([7.0]) is fixed
    assert fixed.text(0.25) == "25 %"
    assert Axis("flat").holding([0.0, 0.0]).high > 0


@pytest.fixture
def chart(qtbot):
    made = Chart("Noise", Axis("noise, px", 0, 4), Axis("success, %", 0, 1, fixed=True, scale=100))
    qtbot.addWidget(made)
    made.resize(320, 240)
    made.show_series(
        (
            Series("a", (0.0, 2.0, 4.0), (1.0, 0.5, 0.0), 0),
            Series("b", (0.0, 4.0), (0.0, math.nan), 1),
        )
    )
    return made


def pixels(widget):
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    bits = np.frombuffer(image.constBits(), np.uint8).copy()
    return bits.reshape(image.height(), image.width(), 4)[..., :3]


def test_a_line_is_painted_where_its_numbers_are(chart):
    colour = series_colour(0, chart.colours)
    box = chart._box()
    seen = pixels(chart)
    for share_x, share_y in ((0.0, 1.0), (0.5, 0.5), (1.0, 0.0)):
        x, y = box.left() + share_x * box.width(), box.bottom() - share_y * box.height()
        assert seen[round(y), round(x)].tolist() == [colour.blue(), colour.green(), colour.red()]


def test_the_point_under_the_cursor_tells_its_numbers(chart):
    box = chart._box()
    assert chart.told_at(box.center()) == "a: 2, 50"
    assert chart.told_at(QPointF(box.right(), box.top())) == ""
    assert "b" not in chart.told_at(QPointF(box.right(), box.bottom()))  # NaN is nowhere
    assert "2 gives 0.5" in chart.accessibleDescription()


def test_an_empty_chart_and_a_tiny_one_can_be_painted(chart):
    chart.show_series(())
    assert pixels(chart).any()
    chart.resize(40, 30)
    assert pixels(chart).shape == (chart.height(), chart.width(), 3)


@pytest.mark.parametrize("theme", THEMES)
def test_eight_lines_differ_without_colour_and_are_seen(theme):
    colours = THEMES[theme]
    looks = {(tuple(series_pen(k, colours).dashPattern()), k % 6) for k in range(8)}
    assert len(looks) == 8
    if theme == "night":
        assert all(
            series_colour(k, colours).green() == series_colour(k, colours).blue() == 0
            for k in range(8)
        )


def test_a_legend_wraps_and_speaks(qtbot):
    legend = Legend()
    qtbot.addWidget(legend)
    legend.show_names(tuple((f"method number {k}", k) for k in range(6)))
    assert legend.heightForWidth(200) > legend.heightForWidth(2000) > 0
    assert "method number 5" in legend.accessibleDescription()
    legend.resize(200, legend.heightForWidth(200))
    assert pixels(legend).any()
