"""The bar of progress: it tells its share, and is painted when the window is, not at once."""

import pytest
from PySide6.QtWidgets import QVBoxLayout, QWidget

from kochab.window.widgets import STEPS, ProgressBar


class Painted(QWidget):
    """Counts how often it is painted."""

    def __init__(self):
        super().__init__()
        self.times = 0

    def paintEvent(self, event):  # noqa: N802 (Qt names it)
        self.times += 1


@pytest.mark.parametrize(("share", "value"), [(0.0, 0), (0.25, 250), (1.0, 1000), (7.0, 1000)])
def test_a_share_is_shown(qtbot, share, value):
    bar = ProgressBar("Progress")
    qtbot.addWidget(bar)
    bar.show_share(share)
    assert (bar.value(), bar.maximum()) == (value, STEPS)


def test_a_share_that_is_not_known_runs_and_is_known_again(qtbot):
    bar = ProgressBar("Progress of a test")
    qtbot.addWidget(bar)
    assert bar.accessibleName() == "Progress of a test"
    bar.show_share(None)
    assert (bar.minimum(), bar.maximum()) == (0, 0)
    bar.show_share(0.5)
    assert bar.value() == 500


def test_many_steps_paint_what_waits_beside_them_once(qtbot):
    window, bar, beside = QWidget(), ProgressBar("Progress"), Painted()
    column = QVBoxLayout(window)
    column.addWidget(bar)
    column.addWidget(beside, 1)
    window.resize(300, 200)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitExposed(window)
    qtbot.waitUntil(lambda: beside.times > 0)
    qtbot.wait(20)
    before = beside.times
    for step in range(20):
        beside.update()
        bar.show_share(step / 20)
    assert beside.times == before
    qtbot.waitUntil(lambda: beside.times > before)
    assert beside.times == before + 1
    for step in range(20):  # what this is about: Qt's own way paints each time
        beside.update()
        bar.setValue(50 * step)
    assert beside.times > before + 10
