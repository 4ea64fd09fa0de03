"""A practice night as a person has it, on whatever screen there is: from the welcome page to M 42.

``python -m tests.window.practice_on_screen FOLDER [--plain]`` presses the buttons of the real window over a
simulated telescope on a line of its own, saves ``mount.png`` and ``mount-night.png``, and prints
where the telescope truly points in the end and how long the window was ever away.
"""

import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QEventLoop, QSettings, Qt, QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from kochab.core.attitude import apart_deg, radec_deg
from kochab.core.frame import Site
from kochab.simulate.practice import PracticeNight
from kochab.simulate.rig import misaligned, practice_night, through, tonight
from kochab.sky.finder import finder
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.mount.pointing import SyncDialog
from kochab.window.settings import WindowSettings
from kochab.workflows.session.wiring import Wiring
from tests.window.take_screenshots import keep, pause

SITE = Site(45.0, 8.0, 300.0)
WHEN = 1_768_514_400.0  # 2026-01-15 22:00 UTC: M 42 is near the meridian there
START_DEG = (-35.0, 20.0)  # hour angle, declination: a short way from it
RATE = 4.0
LIMIT_S = 150.0
STARTED = []  # the one practice rig


def practise(**wishes):
    """A rig where M 42 is up whatever the date of this run; the view's wishes otherwise."""
    night = practice_night(misaligned(tonight(3, SITE), None, 3.0), faults=False)
    night = replace(night, start_unix=WHEN, start_deg=START_DEG, rate=RATE)
    rig = through(night, wishes["fov_deg"])
    STARTED.append(PracticeNight(rig))
    return STARTED[-1]


def until(true, what):
    """Let the window live until something is so."""
    loop, looks = QEventLoop(), QTimer()
    end = time.monotonic() + LIMIT_S
    looks.timeout.connect(lambda: loop.quit() if true() or time.monotonic() > end else None)
    looks.start(20)
    loop.exec()
    looks.stop()
    if not true():
        raise SystemExit(f"waited in vain for {what}")


class Pulse:
    """The longest time the window's event loop was away, and worked itself without a pause.

    The first counts what other programs take of the processor, too.
    """

    def __init__(self):
        self.worst_ms = self.own_ms = 0.0
        self._wall, self._cpu = time.perf_counter(), time.thread_time()
        self._timer = QTimer()
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._beat)
        self._timer.start(5)

    def _beat(self):
        wall, cpu = time.perf_counter(), time.thread_time()
        self.worst_ms = max(self.worst_ms, (wall - self._wall) * 1e3 - 5.0)
        self.own_ms = max(self.own_ms, (cpu - self._cpu) * 1e3)
        self._wall, self._cpu = wall, cpu


def night_out(window, commands, folder, plain):
    """Practice, look, sync, centre M 42; what came of it."""
    window.welcome.practice.click()
    view = commands.views.docks["mount"].view
    control = view.control
    said = []
    control.message.connect(lambda sentence, role: said.append(sentence))
    until(lambda: control.known.report is not None, "the connection")
    pulse = Pulse()
    view.buttons.take.click()
    until(lambda: control.known.sight is not None and not control.known.busy, "a solved frame")
    first = view.pointing.offset.text()
    view.buttons.sync.click()
    until(lambda: bool(window.findChildren(SyncDialog)), "the preview")
    window.findChildren(SyncDialog)[0].yes.click()
    until(lambda: control.known.report.can_undo and not control.known.busy, "the sync")
    view.go.target.setText("M 42")
    view.go.centre.click()
    until(lambda: not control.known.busy, "the centring")
    truth = STARTED[-1].rig.truth()
    gaps = {"longest_gap_ms": round(pulse.worst_ms), "own_work_ms": round(pulse.own_ms)}
    pause(700)
    keep(window, folder / "mount.png", plain)
    commands.actions["night"].trigger()
    until(lambda: commands.appearance.settled, "the night")
    pause(400)
    keep(window, folder / "mount-night.png", plain)
    away = apart_deg(truth.ra_dec_deg, radec_deg(finder().still("M 42").vector)) * 3600.0
    return {
        "off_at_first": first,
        "said": said[-1],
        "away_arcsec": away,
        "tracked": view.pointing.offset.text(),
        **gaps,
    }


def main(folder, *arguments):
    app = QApplication([])
    folder = Path(folder)
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings, wiring=Wiring(practice=practise))
        window.resize(1360, 860)
        window.show()
        window.activateWindow()
        pause(500)
        told = {
            "platform": QGuiApplication.platformName(),
            **night_out(window, commands, folder, "--plain" in arguments),
        }
        window.close()
        print(json.dumps(told))
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
