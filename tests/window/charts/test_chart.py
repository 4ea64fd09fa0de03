"""Charts: lines lie where their numbers are, points tell them, and keys move what is seen."""

import csv
import io
import math
import subprocess
import sys

import numpy as np
import pyqtgraph as pg
import pytest
from PIL import Image
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QMessageBox

from kochab.window.charts.chart import Chart, Legend
from kochab.window.charts.series import ChartAxis, Series, line_style
from kochab.window.image.frame_image import ScreenStretch
from kochab.window.image.stretch_strip import Histogram
from kochab.window.live.camera_panel import LevelView
from kochab.window.live.rendering import levels_of
from kochab.window.themes import THEMES, theme_colours

NOISE = ChartAxis("noise", "px", (0.0, 4.0))
SUCCESS = ChartAxis("success", "%", (0.0, 100.0))
FALLING = Series("a", (0.0, 2.0, 4.0), (100.0, 50.0, 0.0), 0)
BROKEN = Series("b", (0.0, 2.0, 4.0), (100.0, math.nan, 100.0), 1)


@pytest.fixture
def put(qtbot):
    """Show a place of a plot and wait for its plot."""

    def shown(place, width=320, height=240):
        qtbot.addWidget(place)
        place.resize(width, height)
        place.show()
        qtbot.waitUntil(lambda: place.plot is not None and place.plot.isVisible())
        place.grab()  # the range follows what is drawn when that is painted
        return place

    return shown


@pytest.fixture
def chart(put):
    made = Chart("Noise", NOISE, SUCCESS)
    made.show_series((FALLING, BROKEN))
    return put(made)


def pixels(widget):
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    bits = np.frombuffer(image.constBits(), np.uint8).copy()
    return bits.reshape(image.height(), image.width(), 4)[..., 2::-1]


def rgb(colour):
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]


def place_of(chart, x, y):
    """Where a point of the plane of the axes lies on the widget."""
    box = chart.plot.getViewBox()
    scene = box.mapViewToScene(QPointF(x, y))
    return chart.plot.mapTo(chart, chart.plot.mapFromScene(scene))


def seen_range(chart):
    return np.array(chart.plot.getViewBox().viewRange())


@pytest.mark.parametrize("theme", THEMES)
def test_a_line_is_painted_where_its_numbers_are(chart, use_theme, theme):
    use_theme(theme)
    seen = pixels(chart)
    for x, y in ((0.0, 100.0), (2.0, 50.0), (4.0, 0.0)):
        at = place_of(chart, x, y)
        number = 1 if (x, y) == (0.0, 100.0) else 0  # there the other line lies above
        assert seen[at.y(), at.x()].tolist() == rgb(line_style(number, THEMES[theme]).colour)
    between, gap = place_of(chart, 1.0, 75.0), place_of(chart, 2.0, 100.0)
    line = seen[between.y() - 1 : between.y() + 2, between.x()].astype(int)
    wanted = np.array(rgb(line_style(0, THEMES[theme]).colour))
    assert np.abs(line - wanted).sum(axis=1).min() < 60
    about = seen[gap.y() - 1 : gap.y() + 2, gap.x() - 1 : gap.x() + 2].astype(int)  # ground, or a line of the grid
    broken = np.array(rgb(line_style(1, THEMES[theme]).colour))
    assert np.abs(about - broken).sum(axis=2).min() > 100  # NaN: no line
    ground = seen[at.y() - 30, 3]
    assert ground.tolist() == rgb(THEMES[theme].surface)


def test_a_span_is_seen_whole_and_another_axis_follows_the_lines(put):
    free = Chart("Time", ChartAxis("stars"), ChartAxis("time", "ms", log=True))
    free.show_series((Series("a", (4.0, 50.0), (1.0, 1000.0)),))
    put(free)
    (left, right), (low, high) = seen_range(free)
    assert left < 4 < 50 < right < 60
    assert -0.5 < low < 0 < 3 < high < 3.5
    free.show_series((Series("a", (4.0, 500.0), (1.0, 10.0)),))
    pixels(free)
    assert seen_range(free)[0][1] > 500
    fixed = put(Chart("Noise", ChartAxis("margin", "px", (0.25, 20.0), log=True), SUCCESS))
    (left, right), (low, high) = seen_range(fixed)
    assert -0.8 < left < math.log10(0.25) < math.log10(20.0) < right < 1.5
    assert -10 < low < 0 < 100 < high < 110


def test_axes_say_what_they_are_with_their_units(chart):
    assert chart.plot.getAxis("bottom").label.toPlainText().strip() == "noise, px"
    assert chart.plot.getAxis("left").label.toPlainText().strip() == "success, %"
    decades = chart.plot.getAxis("left").logTickStrings([0.0, math.log10(3), math.log10(5), 3.0], 1, 1)
    assert decades == ["1", "", "5", "1000"]


def test_a_point_tells_its_numbers_under_the_cursor_and_to_who_cannot_see(chart):
    (scatter,) = (
        i.scatter
        for i in chart.plot.listDataItems()
        if i.curve.opts["pen"].color().name() == line_style(0, theme_colours()).colour
    )
    tips = [scatter.opts["tip"](x=0, y=0, data=point.data()) for point in scatter.points()]
    assert tips == ["a: 0 px, 100 %", "a: 2 px, 50 %", "a: 4 px, 0 %"]
    assert "2 gives 50" in chart.accessibleDescription()
    assert chart.plot.accessibleDescription() == chart.accessibleDescription()
    assert chart.plot.accessibleName() == "Noise"


def test_what_has_no_number_is_not_drawn(put, chart):
    chart.show_series((Series("nothing", (1.0, 2.0), (math.nan, math.nan), 2),))
    chart.show_series(())
    assert not chart.plot.listDataItems()
    assert pixels(chart).any()
    log = Chart("Error", ChartAxis("time", "min"), ChartAxis("error", "″", log=True))
    log.show_series((Series("a", (0.0, 1.0, 2.0), (0.0, 100.0, 10.0)),))
    put(log)
    assert pixels(log).any()
    log.resize(40, 30)
    assert pixels(log).any()


def test_bars_are_one_sigma_also_on_a_logarithmic_axis(put):
    chart = Chart("Error", ChartAxis("time", "min"), ChartAxis("error", "″", log=True), legend=True)
    chart.show_series((Series("measured", (0.0, 3.0), (600.0, 70.0), 1, (300.0, 30.0)),))
    put(chart)
    (bars,) = (i for i in chart.plot.getPlotItem().items if isinstance(i, pg.ErrorBarItem))
    ends = bars.opts["y"] - bars.opts["bottom"], bars.opts["y"] + bars.opts["top"]
    assert np.allclose(10 ** np.array(ends), [[300.0, 40.0], [900.0, 100.0]])
    assert [label.text for _, label in chart.plot.getPlotItem().legend.items] == ["measured"]
    chart.show_series(())
    assert not [i for i in chart.plot.getPlotItem().items if isinstance(i, pg.ErrorBarItem)]
    assert not chart.plot.getPlotItem().legend.items


def test_keys_move_and_zoom_and_home_brings_all_back(qtbot, chart):
    home = seen_range(chart)
    qtbot.keyClick(chart.plot, Qt.Key.Key_Right)
    assert np.allclose(seen_range(chart)[0], home[0] + 0.1 * np.ptp(home[0]))
    qtbot.keyClick(chart.plot, Qt.Key.Key_Down)
    assert seen_range(chart)[1][0] < home[1][0]
    qtbot.keyClick(chart.plot, Qt.Key.Key_Plus)
    assert np.ptp(seen_range(chart)[0]) == pytest.approx(0.8 * np.ptp(home[0]))
    qtbot.keyClick(chart.plot, Qt.Key.Key_Minus)
    assert np.ptp(seen_range(chart)[0]) == pytest.approx(np.ptp(home[0]))
    qtbot.keyClick(chart.plot, Qt.Key.Key_Home)
    assert np.allclose(seen_range(chart), home)
    chart.setFocus()
    assert chart.focusProxy() is chart.plot


def test_its_menu_says_what_can_be_done(chart):
    menu = chart.menu()
    texts = [action.text().split("\t")[0].replace("&", "") for action in menu.actions()]
    assert texts == ["Show all", "Zoom in", "Zoom out", "", "Save image…", "Save numbers…"]
    before = seen_range(chart)
    menu.actions()[1].trigger()
    assert np.ptp(seen_range(chart)[0]) < np.ptp(before[0])
    menu.actions()[0].trigger()
    assert np.allclose(seen_range(chart), before)


def test_a_chart_is_written_as_picture_and_as_numbers(qtbot, chart, tmp_path):
    for name in ("noise.csv", "noise.png"):
        with qtbot.waitSignal(chart.write(tmp_path / name).finished):
            pass
    rows = list(csv.reader(io.StringIO((tmp_path / "noise.csv").read_text("utf-8"))))
    assert rows[0] == ["line", "noise, px", "success, %", "sigma"]
    assert rows[2] == ["a", "2.0", "50.0", ""]
    with Image.open(tmp_path / "noise.png") as image:
        assert image.size == (640, 480)
        assert rgb(line_style(0, theme_colours()).colour) in np.asarray(image.convert("RGB")).reshape(-1, 3).tolist()
    with qtbot.waitSignal(chart.write(tmp_path / "no" / "noise.csv").finished):
        pass
    (box,) = chart.window().findChildren(QMessageBox)
    assert box.text().startswith("Can't write noise.csv")
    box.close()


@pytest.mark.parametrize("theme", THEMES)
def test_eight_lines_differ_without_colour(theme):
    styles = [line_style(k, THEMES[theme]) for k in range(8)]
    assert len({(s.dashes, s.marker) for s in styles}) == 8


def test_a_legend_wraps_and_speaks(put):
    legend = Legend()
    legend.show_names(tuple((f"method number {k}", k) for k in range(6)))
    put(legend, 220, 30)
    narrow = legend.height()
    legend.resize(2000, narrow)
    assert legend.height() < narrow
    assert "method number 5" in legend.accessibleDescription()
    found = {tuple(c) for c in pixels(legend).reshape(-1, 3)}
    for k in range(6):
        assert tuple(rgb(line_style(k, theme_colours()).colour)) in found


def test_at_night_everything_of_a_plot_is_red(put, use_theme):
    legend, bars, levels = Legend(), Histogram(), LevelView()
    chart = Chart("Error", ChartAxis("time", "min"), ChartAxis("error", "″", log=True), legend=True)
    legend.show_names((("a", 0), ("b", 1), ("c", 2)))
    bars.set_counts(np.arange(256.0))
    bars.set_stretch(ScreenStretch(0.1, 0.2))
    levels.show_levels(levels_of(np.linspace(0, 4000, 5000), 3000.0))
    chart.show_series((Series("a", (1.0, 2.0, 3.0), (9.0, 4.0, 7.0), 1, (1.0, 2.0, 3.0)),))
    use_theme("night")
    for place in (legend, bars, levels, chart):
        seen = pixels(put(place))
        assert seen[..., 0].max() > 150
        assert not seen[..., 1:].any()


def test_a_histogram_shows_its_counts_and_the_stretch(put):
    view = Histogram()
    counts = np.zeros(256)
    counts[64:128] = 1000.0
    view.set_counts(counts)
    view.set_stretch(ScreenStretch(0.0, 0.5))
    put(view, 300, 100)
    without, black = pixels(view), rgb(theme_colours().text)
    ground = rgb(theme_colours().surface)
    row = without[10]  # the curve is lower there
    assert row[int(300 * 0.37)].tolist() != ground
    assert row[int(300 * 0.15)].tolist() == row[int(300 * 0.7)].tolist() == ground
    view.set_stretch(ScreenStretch(0.6**3, 0.5))
    at = place_of(view, 0.6, 0.5).x()
    assert black in pixels(view)[:, at - 1 : at + 2].reshape(-1, 3).tolist()
    assert view.focusPolicy() == view.plot.focusPolicy() == Qt.FocusPolicy.NoFocus


def test_the_library_is_loaded_when_a_plot_is_seen_and_not_before():
    """In a process of its own, where nothing has loaded it yet; a thread loads it and makes no type of Qt's."""
    code = """
import sys
from PySide6.QtCore import QEventLoop, QTimer
from PySide6.QtWidgets import QApplication
import kochab.window.application, kochab.window.laboratory.view, kochab.window.polar.view, kochab.window.live.view
from kochab.window.charts import plot_area
from kochab.window.charts.chart import Chart
from kochab.window.charts.series import ChartAxis as Axis, Series
class Watch:
    left = None
    def find_spec(self, name, path=None, target=None):
        if name == "pyqtgraph":
            self.left = list(plot_area._TYPES)
watch = Watch()
sys.meta_path.insert(0, watch)
app = QApplication([])
chart = Chart("Noise", Axis("noise", "px"), Axis("success", "%"))
chart.show_series((Series("a", (0.0, 1.0), (1.0, 2.0)),))
assert "pyqtgraph" not in sys.modules
chart.show()
assert "pyqtgraph" not in sys.modules
loop, timer = QEventLoop(), QTimer()
timer.timeout.connect(lambda: loop.quit() if chart.plot is not None else None)
timer.start(5)
loop.exec()
assert len(chart.plot.listDataItems()) == 1
assert watch.left == [], watch.left
chart.grab()
print("MADE")
"""
    found = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=120)
    assert found.stdout.strip() == "MADE", found.stderr
