"""Print what the window promises of speed: its first paint, a large image from click to annotated, paints while zooming.

``python -m tests.window.measure_speed`` on whatever screen there is, on a machine that does nothing else. How long the
event loop is kept from answering is :mod:`tests.window.measure_gaps`.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from astropy.io import fits
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.simulate.star_images import RenderedStar, render
from kochab.sky import open_catalogue
from kochab.sky.layer import MARKS
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from tests.window.take_screenshots import pause

STARTS, OPENS = 7, 5
SIDE_PX, FIELD_DEG = (9576, 6388), 4.0  # 61 MP
ZOOM, PAINTS = 1.07, 240
FIRST_PAINT = """
import sys, time
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QApplication
app = QApplication(sys.argv[:1])
class Watch(QObject):
    def eventFilter(self, watched, event):
        if event.type() == QEvent.Type.Paint:
            app.removeEventFilter(self)
            QTimer.singleShot(0, lambda: (print(time.monotonic()), app.exit(0)))
        return False
watch = Watch()
app.installEventFilter(watch)
from kochab.window.application import run
run()
"""


def first_paint_s() -> float:
    """From the start of a process to the end of the event loop's turn that painted first."""
    with tempfile.TemporaryDirectory() as home:
        kept = {f"XDG_{name}_HOME": str(Path(home, name)) for name in ("CONFIG", "DATA", "STATE")}
        begun = time.monotonic()
        told = subprocess.run(
            [sys.executable, "-c", FIRST_PAINT], env=os.environ | kept, capture_output=True, text=True, check=True
        )
    return float(told.stdout.split()[0]) - begun


def large_frame(path: Path) -> None:
    """The sky at Cassiopeia on a sensor of 61 MP."""
    width, height = SIDE_PX
    camera = Camera.centred(width, height, width / 2 / np.tan(np.radians(FIELD_DEG / 2)))
    attitude, catalogue = attitude_from(15.0, 60.5, 20.0), open_catalogue()
    rows = catalogue.brightest(attitude.boresight, np.radians(FIELD_DEG), 4000)
    xy = camera.project(catalogue.vectors(rows) @ attitude.matrix.T)
    flux = 3e5 * 10 ** (-0.4 * (catalogue.mag(rows) - 8.0))
    fits.writeto(path, render(width, height, xy, flux, RenderedStar(3.0)).pixels)


def told(what: str, values: list[float], unit: str, goal: str) -> None:
    low, middle, high = np.min(values), np.median(values), np.max(values)
    print(f"{what:44s} median {middle:7.3f} {unit} ({low:.3f} to {high:.3f}, {len(values)})  {goal}", flush=True)


def main() -> None:
    paints = [first_paint_s() for _ in range(STARTS)]
    told("first paint, the first start of this run", paints[:1], "s", "goal 2 where nothing is cached")
    told("first paint, warm", paints[1:], "s", "goal 1.0")
    app = QApplication([])
    with tempfile.TemporaryDirectory() as home:
        path = Path(home, "large.fits")
        large_frame(path)
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings)
        window.resize(1600, 1000)
        window.show()
        pause(4000)  # libraries are loaded meanwhile
        view, overlay = window.workspace.view, commands.presenter.overlay
        done: list[float] = []
        paint = view.marks

        def painted(painter, viewport):
            paint(painter, viewport)
            if overlay.solution is not None and overlay.tables is not None and overlay.labels and not done:
                done.append(time.monotonic())

        view.marks = painted
        took = []
        for _ in range(OPENS + 1):
            done.clear()
            begun = time.monotonic()
            commands.files.open(path)
            while not done:
                app.processEvents()
                assert time.monotonic() < begun + 60.0, "it was not solved"
            took.append(done[0] - begun)
            pause(500)
        told("61 MP from click to annotated, the first", took[:1], "s", "")
        told("61 MP from click to annotated", took[1:], "s", "goal 0.3")
        for name in MARKS:
            commands.actions[name].setChecked(True)
        pause(500)
        each = []
        for k in range(PAINTS):
            begun = time.perf_counter()
            view._zoom(ZOOM if (k // 40) % 2 == 0 else 1.0 / ZOOM)
            view.repaint()
            each.append(time.perf_counter() - begun)
        told("one paint while zooming, every layer on", [1e3 * s for s in each], "ms", "goal 16.7")
        print(f"{1.0 / np.mean(each):.0f} paints a second, {np.percentile(each, 95) * 1e3:.1f} ms at 95 %  goal 60")
        window.close()
        commands.session.jobs.join()


if __name__ == "__main__":
    main()
