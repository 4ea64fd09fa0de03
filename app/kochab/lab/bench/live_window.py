"""Measures the real window on a stream of given frames: ``python -m kochab.lab.bench.live_window FOLDER``.

``FOLDER`` holds ``frames.npy`` (N, H, W), the frames of half a swing to be shown forth and back,
and ``about.json`` with ``fps``, ``seconds``, ``exposure_s`` and perhaps ``bayer``. They come in
real time, as from a camera that has no readout. One JSON object is printed: frames drawn and
tracked a second, and the milliseconds from mid-exposure until a frame with its overlay was painted.
"""

import json
import sys
import tempfile
from datetime import UTC, datetime, timedelta
from pathlib import Path
from time import monotonic, process_time, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.frame import Frame, Hint
from kochab.window.application import Garbage, build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.live.view import LiveView
from kochab.window.settings import WindowSettings
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.session.live_stream import StreamRequest

WARM_LIMIT_S = 60.0
WARM_S = 1.0  # of tracking, before anything counts
SIZE = (1360, 860)


class GivenFrames(CameraSource):
    """A camera that gives prepared frames by the clock; one that comes late is left out."""

    name = "given frames"

    def __init__(self, frames: NDArray[Any], fps: float, exposure_s: float, bayer: str | None = None) -> None:
        self._frames, self._fps, self._exposure_s = frames, fps, exposure_s
        self._bayer = bayer
        self._begun, self._given = monotonic(), -1

    @property
    def limits(self) -> CaptureLimits:
        """Nothing can be set."""
        return CaptureLimits()

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Nothing is."""
        return CaptureSettings(exposure_s=self._exposure_s)

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The frame whose exposure ended last."""
        due = self._begun + (self._given + 1) / self._fps
        sleep(max(0.0, min(timeout_s, due - monotonic())))
        number = int((monotonic() - self._begun) * self._fps)
        if number <= self._given:
            return None
        self._given = number
        ended = self._begun + number / self._fps
        middle = timedelta(seconds=monotonic() - ended + self._exposure_s / 2.0)
        hint = Hint(exposure_s=self._exposure_s, time_utc=datetime.now(UTC) - middle)
        period = 2 * (len(self._frames) - 1)  # forth and back, each end once
        at = number % period
        pixels = self._frames[min(at, period - at)]
        return Frame(pixels, bayer=self._bayer, saturation=65535.0, hint=hint)

    def close(self) -> None:
        """Nothing is held."""


def measure(view: LiveView, source: GivenFrames, seconds: float) -> dict[str, Any]:
    """Run ``source`` in the view and count for ``seconds``, once it is tracked."""
    view.run(StreamRequest(lambda: source, source.name))
    begun = monotonic()
    while not _tracks(view) and monotonic() - begun < WARM_LIMIT_S and view.stream is not None:
        _pass(0.1)
    _pass(WARM_S)
    drawn: list[tuple[LiveUpdate | None, float | None]] = []
    connection = view.display.drawn.connect(lambda ready: drawn.append((ready.update, view.display.latency_ms)))
    wall, spent = monotonic(), process_time()
    _pass(seconds)
    wall, spent = monotonic() - wall, process_time() - spent
    view.display.drawn.disconnect(connection)
    view.end()
    solved = [(update.mode, ms) for update, ms in drawn if update is not None and ms is not None]
    latency_ms = [ms for _, ms in solved] or [float("nan")]
    return {
        "frames": len(drawn),
        "drawn_s": len(drawn) / wall,
        "tracked_s": sum(mode == "tracking" for mode, _ in solved) / wall,
        "cores": spent / wall,
        "median_ms": float(np.median(latency_ms)),
        "p95_ms": float(np.percentile(latency_ms, 95)),
        "worst_ms": max(latency_ms),
        "platform": QGuiApplication.platformName(),
    }


def _tracks(view: LiveView) -> bool:
    latest = None if view.stream is None else view.stream.latest
    return latest is not None and latest.mode == "tracking"


def _pass(seconds: float) -> None:
    loop = QEventLoop()
    QTimer.singleShot(round(1e3 * seconds), loop.quit)
    loop.exec()


def main(folder: str) -> int:
    """Measure what lies in ``folder`` and print it."""
    stream = json.loads(Path(folder, "about.json").read_text("utf-8"))
    frames = np.load(Path(folder, "frames.npy"))
    app = QApplication([])
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings, [])
        garbage = Garbage()
        window.resize(*SIZE)
        window.show()
        commands.views.show("live")
        _pass(0.5)
        view = commands.views.docks["live"].view
        assert isinstance(view, LiveView)
        source = GivenFrames(frames, float(stream["fps"]), float(stream["exposure_s"]), stream.get("bayer"))
        print(json.dumps(measure(view, source, float(stream["seconds"]))), flush=True)
        _pass(0.3)
        window.close()
        garbage.stop()
    app.quit()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
