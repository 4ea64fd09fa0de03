"""Print how long the window keeps its event loop from answering, whatever the person does.

``python -m tests.window.measure_gaps [MEGAPIXELS]`` opens the real window on whatever screen there is,
opens a rendered frame of that size (61 when not said), changes the theme, opens every view, and
prints the longest gaps between two answers of the event loop during each, and how much processor
time of the window's own thread was in them (in brackets): the rest is other programs and other
threads. ``--where`` adds what the window was doing in the longest gaps.
"""

import sys
import tempfile
import threading
import time
import traceback
from pathlib import Path

import numpy as np
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from kochab.window.application import Background, Garbage, build, whole_engine
from kochab.window.settings import WindowSettings

TICK_MS = 2
LONG_S = 0.030


class Pulse:
    """A timer that should fire every two milliseconds, and what it noticed."""

    def __init__(self, where=False):
        self.gaps, self.stacks = [], []
        self._last, self._spent = time.perf_counter(), time.thread_time()
        self._main, self._where = threading.main_thread().ident, where
        self._timer = QTimer()
        self._timer.timeout.connect(self.tick)
        self._timer.start(TICK_MS)
        if where:
            threading.Thread(target=self._watch, daemon=True).start()

    def tick(self):
        now, spent = time.perf_counter(), time.thread_time()
        self.gaps.append((now - self._last, spent - self._spent))
        self._last, self._spent = now, spent

    def _watch(self):
        while True:
            time.sleep(0.005)
            late = time.perf_counter() - self._last
            if late > LONG_S:
                frame = sys._current_frames().get(self._main)
                lines = traceback.extract_stack(frame)[-4:]
                self.stacks.append(
                    (late, " < ".join(f"{Path(f.filename).name}:{f.lineno} {f.name}" for f in lines[::-1]))
                )

    def report(self, what):
        gaps = sorted(self.gaps)
        worst = " ".join(f"{1e3 * g:.0f} ({1e3 * s:.0f})" for g, s in gaps[-4:][::-1])
        over, own = (sum(g[k] > 0.05 for g in gaps) for k in (0, 1))
        print(f"{what:32s} longest ms: {worst:34s} over 50 ms: {over}, by itself {own}", flush=True)
        if self._where:
            for late, stack in sorted(self.stacks)[-6:]:
                print(f"      {1e3 * late:4.0f} ms  {stack}")
        self.gaps.clear()
        self.stacks.clear()
        self._last, self._spent = time.perf_counter(), time.thread_time()


def wait(ms, signal=None):
    loop = QEventLoop()
    if signal is not None:
        signal.connect(loop.quit)
    QTimer.singleShot(ms, loop.quit)
    loop.exec()


def make_frame(path, megapixels):
    from astropy.io import fits

    side = np.sqrt(megapixels * 1e6 / 1.5)
    height, width = int(side), int(side * 1.5)
    rng = np.random.default_rng(3)
    image = np.tile(rng.normal(800, 15, (512, width)), (height // 512 + 1, 1))[:height]
    yy, xx = np.mgrid[-5:6, -5:6]
    blob = np.exp(-(xx**2 + yy**2) / 4.5)
    for x, y in rng.integers(10, (width - 10, height - 10), (1500, 2)):
        image[y - 5 : y + 6, x - 5 : x + 6] += 10 ** rng.uniform(2, 4) * blob
    fits.writeto(path, image.clip(0, 65535).astype(np.uint16))
    return f"{width} x {height}"


def main(*arguments):
    where = "--where" in arguments
    sizes = [a for a in arguments if not a.startswith("-")]
    app = QApplication([])
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        path = Path(home, "large.fits")
        size = make_frame(path, float(sizes[0]) if sizes else 61.0)
        engine = whole_engine()
        window, commands = build(engine, settings)
        garbage, background = Garbage(), Background(window, engine)
        window.resize(1360, 860)
        window.show()
        wait(500)
        pulse = Pulse(where)
        wait(3500)
        pulse.report("welcome page, libraries loading")
        commands.files.open(path)
        wait(90_000, commands.session.idle)
        wait(400)
        pulse.report(f"opening {size}")
        commands.files.open(path)
        wait(90_000, commands.session.idle)
        wait(400)
        pulse.report("opening it again")
        for name in ("night", "dark", "light", "dark", "night"):
            commands.appearance.use_theme(name)
            wait(300)
            pulse.report(f"theme {name}")
        for name in commands.views.docks:
            commands.actions[name].trigger()
            wait(1500)
            pulse.report(f"opening {name}")
        commands.appearance.use_theme("dark")
        wait(300)
        pulse.report("theme dark with all views")
        window.close()
        garbage.stop()
        background.job.join(5.0)
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
