"""The window's row of the live bench: measured in the real window, in a process of its own."""

import sys

import pytest

from kochab.lab.bench import live
from kochab.lab.bench.live_stream import make_ring


@pytest.fixture(scope="module")
def ring():
    return make_ring(640, 480, count=5, swing_deg=0.05)


def test_the_window_draws_and_tracks_what_it_is_given(ring, monkeypatch) -> None:
    pytest.importorskip("PySide6")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    row = live.window_row(ring, "small", 2.0)
    assert "trouble" not in row, row
    assert row["what"] == "small in the window at 32 frames a second"
    if sys.platform == "linux":
        assert row["platform"] == "offscreen"
    assert row["frames"] > 0
    assert 0 < row["tracked_s"] <= row["drawn_s"] < 40
    assert 10 < row["median_ms"] <= row["p95_ms"] <= row["worst_ms"]
    assert row["cores"] > 0


def test_a_window_that_does_not_run_is_told(ring, monkeypatch) -> None:
    monkeypatch.setattr(live, "MODULE", "app.no_such_module")
    assert live.window_row(ring, "small", 1.0)["trouble"] == "IndexError"
