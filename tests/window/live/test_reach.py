"""The keyboard reaches everything of the Live view, and each control says what it is."""

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from kochab.window.live.camera_panel import LevelView
from kochab.window.live.pointing_panel import SkyChart
from kochab.window.live.rendering import levels_of
from kochab.window.live.sky_points import SkyPoints
from tests.window.live.test_view import Stars, live, run, wait_drawn
from tests.window.test_reach import REACHABLE, mnemonic, tab_stops, usable

__all__ = ["live"]


@pytest.mark.parametrize("tab", [0, 1])
@pytest.mark.parametrize("running", [False, True])
def test_tab_stops_at_every_control(qtbot, live, tab, running):
    view, commands = live
    if running:
        run(view, Stars(0.05))
        wait_drawn(qtbot, view)
    view.tabs.setCurrentIndex(tab)
    stops = tab_stops(qtbot, commands.window)
    controls = [w for kind in REACHABLE for w in view.findChildren(kind) if usable(w)]
    assert len(controls) >= 2
    own = [w for w in controls if not w.inherits("QComboBoxPrivateContainer")]
    missed = [w for w in own if w not in stops and w.focusPolicy() != Qt.FocusPolicy.NoFocus]
    assert not missed, [(w.metaObject().className(), w.accessibleName()) for w in missed]
    silent = [w for w in own if not (w.accessibleName() or getattr(w, "text", str)())]
    assert not silent, [w.metaObject().className() for w in silent]


def test_mnemonics_differ(live):
    view, _ = live
    texts = [w.text() for w in view.findChildren(type(view.start)) if w.isVisible()]
    texts += [w.text() for w in view.findChildren(QLabel) if w.isVisible() and w.buddy()]
    texts += [view.record.switch.text(), view.camera.reconnect.text()]
    letters = sorted(m for t in texts if (m := mnemonic(t)))
    assert len(letters) == len(set(letters)), letters


def test_f2_opens_it_and_puts_the_focus_on_start(qtbot, opened):
    window, commands = opened
    qtbot.keyClick(window, Qt.Key.Key_F2)
    view = commands.views.docks["live"].view
    assert view is not None
    qtbot.waitUntil(lambda: view.start.hasFocus() or window.focusWidget() is view.start)


def test_the_chart_draws_the_trail_and_marks_an_old_place(qtbot):
    chart = SkyChart()
    qtbot.addWidget(chart)
    chart.resize(400, 206)
    chart.show()
    qtbot.waitUntil(lambda: chart.plot is not None and chart.plot.isVisible())
    empty = _pixels(chart)
    chart.show_points(SkyPoints(np.eye(3), np.array([0.0, 1.0, 2.0]), np.eye(3)[None, :2]))
    stars = _pixels(chart)
    chart.show_pointing(np.array([1.0, 0.0, 0.0]), old=False)
    new = _pixels(chart)
    chart.show_pointing(np.array([0.6, 0.8, 0.0]), old=True)
    old = _pixels(chart)
    for before, after in ((empty, stars), (stars, new), (new, old)):
        assert (before != after).any()
    assert "Last known" in chart.accessibleDescription()
    chart.clear()
    assert (_pixels(chart) != old).any()


def test_full_pixels_are_seen_in_the_histogram(qtbot):
    view = LevelView()
    qtbot.addWidget(view)
    view.resize(200, 56)
    view.show()
    qtbot.waitUntil(lambda: view.plot is not None and view.plot.isVisible())
    values = np.linspace(0, 4000, 5000)
    view.show_levels(levels_of(values, 65535.0))
    fine = _pixels(view)
    view.show_levels(levels_of(values, 3000.0))
    assert (_pixels(view) != fine).any()


def _pixels(widget):
    image = widget.grab().toImage()
    return np.frombuffer(image.constBits(), np.uint8).copy()
