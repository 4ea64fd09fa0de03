"""The page of the night: empty until something was measured, then a curve with its doubts."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pyqtgraph as pg
import pytest

from kochab.polar.report import Entry, History
from kochab.window.polar.history import HistoryPage

BEGUN = datetime(2026, 1, 1, 22, 0, tzinfo=UTC)


def entry(after_s, error_arcsec, kind, text=""):
    return Entry(
        BEGUN + timedelta(seconds=after_s),
        kind,
        error_arcsec,
        0.0,
        0.0,
        error_arcsec,
        (0.1 * error_arcsec, 1.0),
        (5.0, 4.0, 0.0),
        text,
        0.1 * error_arcsec,
    )


@pytest.fixture
def page(qtbot):
    made = HistoryPage(SimpleNamespace())
    qtbot.addWidget(made)
    made.resize(640, 560)
    made.show()
    return made


def test_nothing_but_a_sentence_is_seen_before_anything_was_measured(page):
    assert "No alignment measured" in page.summary.text()
    seen = (page.which, page.save, page.chart, page.lines)
    assert not any(part.isVisible() for part in seen)
    page.keep(History(entries=[entry(0, 600.0, "measured")]))
    assert all(part.isVisible() for part in seen)


def test_a_measurement_has_bars_and_what_was_seen_has_none(qtbot, page):
    history = History(entries=[entry(0, 600.0, "measured", "It may bend by 17″ more.")])
    history.entries += [entry(60, 300.0, "live"), entry(120, 100.0, "live")]
    history.entries.append(entry(180, 50.0, "measured"))
    page.keep(history)
    qtbot.waitUntil(lambda: page.chart.plot is not None)
    seen, measured = page.chart.series
    assert (seen.name, measured.name) == ("seen", "measured")
    assert measured.x == (0.0, 3.0)
    assert seen.sigma == ()
    (bars,) = (i for i in page.chart.plot.getPlotItem().items if isinstance(i, pg.ErrorBarItem))
    top = 10 ** (bars.opts["y"] + bars.opts["top"])
    assert np.allclose(top, [660.0, 55.0])
    assert "17″ more" in page.lines.toPlainText()
    assert len(page.lines.toPlainText().splitlines()) == 2
