"""Pictures of the Mount mode over a practice telescope, for eyes.

``python -m tests.window.mount_pictures FOLDER`` saves the room in several sizes and themes, with a slew under way and
after it; QT_SCALE_FACTOR sets the scale. It prints how long the chart takes to paint.
"""

import json
import sys
import tempfile
import time
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication

from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.mount.score_card import ScoreCard
from kochab.window.settings import WindowSettings
from kochab.workflows.session.wiring import Wiring
from tests.window.practice_on_screen import practise, until
from tests.window.take_screenshots import pause

SIZES = ((1024, 700), (1366, 768), (1600, 1000))
THEMES = ("dark", "light", "night")


def paint_ms(chart):
    """A paint of what moves alone, and one of all, ms of this thread."""
    chart.grab()
    began = time.thread_time()
    chart.grab()
    marks = time.thread_time() - began
    chart.look(chart.centre, chart.field_deg * 1.01)
    began = time.thread_time()
    chart.grab()
    whole = time.thread_time() - began
    chart.is_light = True  # as while it turns with a slew
    chart.look(chart.centre, chart.field_deg * 1.01)
    began = time.thread_time()
    chart.grab()
    light, chart.is_light = time.thread_time() - began, False
    return {
        name: round(spent * 1e3, 1) for name, spent in (("marks_ms", marks), ("turning_ms", light), ("all_ms", whole))
    }


def main(folder, *sizes):
    app = QApplication([])
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [tuple(map(int, size.split("x"))) for size in sizes] or SIZES
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings, wiring=Wiring(practice=practise))
        window.resize(*wanted[-1])
        window.show()
        commands.views.show("mount")
        view = commands.views.docks["mount"].view
        until(lambda: view.room.chart.catalogue is not None, "the sky")
        pause(600)
        window.grab().save(str(folder / "off.png"))
        view.practise()
        until(lambda: view.control.known.report is not None, "the connection")
        view.buttons.take.click()
        until(lambda: view.control.known.sight is not None and not view.control.known.busy, "a solved frame")
        pause(500)
        window.grab().save(str(folder / "solved.png"))
        view.go.target.setText("M 42")
        pause(900)
        window.grab().save(str(folder / "typed.png"))
        view.go.centre.click()
        until(lambda: view.control.known.left_s is not None, "a slew")
        pause(700)
        window.grab().save(str(folder / "slew.png"))
        until(lambda: not view.control.known.busy, "the centring")
        for size in wanted:
            window.resize(*size)
            for theme in THEMES:
                commands.appearance.use_theme(theme)
                until(lambda: commands.appearance.settled, "the theme")
                pause(400)
                window.grab().save(str(folder / f"{size[0]}-{theme}.png"))
            print(json.dumps({"size": size, "seen": [window.width(), window.height()], **paint_ms(view.room.chart)}))
        commands.appearance.use_theme("dark")
        until(lambda: commands.appearance.settled, "the theme")
        window.resize(1024, 700)
        commands.views.docks["mount"].side.handle.click()
        pause(400)
        window.grab().save(str(folder / "folded.png"))
        print(json.dumps({"folded_px": commands.views.docks["mount"].width()}))
        commands.views.docks["mount"].side.handle.click()
        pause(300)
        window.resize(*wanted[-1])
        view.settings.line.setChecked(True)
        pause(300)
        window.grab().save(str(folder / "unfolded.png"))
        view.leave.click()
        until(lambda: window.findChildren(ScoreCard), "the score")
        pause(300)
        window.findChildren(ScoreCard)[0].grab().save(str(folder / "score.png"))
        window.close()
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
