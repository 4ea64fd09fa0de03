"""An evening's tasks by clicks on the real window, counted and timed.

``python -m tests.window.evening_on_screen [FOLDER [TASK ...]]`` opens and solves an own image, then ten, centres an object of the
image on a simulated telescope, and aligns a simulated mount's polar axis, whose bolts are turned as the instructions
say. It prints a line for each with clicks, keys and seconds. A double click is one, and so is the drop of ten files.
FOLDER gets a picture of each end.
"""

import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PySide6.QtCore import QMimeData, QPoint, QSettings, Qt, QTimer, QUrl
from PySide6.QtGui import QContextMenuEvent, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractItemView, QApplication, QFileDialog, QMenu

from kochab.core.attitude import apart_deg
from kochab.sky.finder import finder
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.window.shell.welcome import samples
from kochab.workflows.session.wiring import Wiring
from tests.window.polar_on_screen import night
from tests.window.practice_on_screen import STARTED, practise, until
from tests.window.take_screenshots import keep, pause

WANTED = {"own image": 2, "ten images": 2, "an object centred": 2, "polar alignment": 6}
LEFT = Qt.MouseButton.LeftButton
LISTS = ("listView", "treeView")  # of a file dialog


class Hand:
    """Clicks on what can be seen, and counts them."""

    def __init__(self):
        self.clicks, self.begun = 0, time.monotonic()

    def click(self, widget, at=None):
        assert widget.isVisible(), widget
        assert widget.isEnabled(), widget
        self.clicks += 1
        QTest.mouseClick(widget, LEFT, pos=widget.rect().center() if at is None else at)

    def choose(self, menu, text):
        """Click an entry of an open menu."""
        action = next(a for a in menu.actions() if a.text().replace("&", "") == text)
        assert action.isEnabled(), text
        self.click(menu, menu.actionGeometry(action).center())

    def choose_file(self, path):
        """Have the dialog that comes next answered by a double click on a file."""

        def answer():
            dialogs = (w for w in QApplication.topLevelWidgets() if isinstance(w, QFileDialog) and w.isVisible())
            views = (v for d in dialogs for v in d.findChildren(QAbstractItemView) if v.objectName() in LISTS)
            names = next((view for view in views if view.isVisible()), None)
            folder = names.rootIndex() if names else None
            found = [names.model().index(k, 0, folder) for k in range(names.model().rowCount(folder))] if names else []
            at = next((index for index in found if index.data() == path.name), None)
            if at is None:
                QTimer.singleShot(100, answer)
                return
            self.clicks += 1
            there = names.visualRect(at).center()
            QTest.mouseClick(names.viewport(), LEFT, pos=there)
            QTest.mouseDClick(names.viewport(), LEFT, pos=there)

        QTimer.singleShot(200, answer)

    def drop(self, window, paths):
        """Let files fall on the window."""
        self.clicks += 1
        data = QMimeData()
        data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
        where = window.rect().center().toPointF()
        window.dropEvent(QDropEvent(where, Qt.DropAction.CopyAction, data, LEFT, Qt.KeyboardModifier.NoModifier))

    def told(self, task, **more):
        seconds = round(time.monotonic() - self.begun, 1)
        print(json.dumps({"task": task, "clicks": self.clicks, "wanted": WANTED[task], "seconds": seconds, **more}))


def solved(window, commands):
    return window.workspace.card.ra.isVisible() and not commands.session.busy


def own_image(window, commands, files):
    hand = Hand()
    commands.settings.keep("folder", str(files[0].parent))
    hand.choose_file(files[0])
    hand.click(window.welcome.first)
    until(lambda: solved(window, commands), "a pointing")
    hand.told("own image", ra=window.workspace.card.ra.text())


def ten_images(window, commands, files):
    hand = Hand()
    hand.drop(window, files)
    until(lambda: len(commands.batch.files) == len(files), "the film strip")
    until(lambda: not commands.batch.waiting and solved(window, commands), "ten pointings")
    hand.told("ten images", said=commands.films.count.text())


def centred(window, commands, picture):
    commands.views.practise()
    control = commands.views.docks["mount"].view.control
    until(lambda: control.known.report is not None, "the connection")
    commands.files.open(picture)
    until(lambda: solved(window, commands), "a pointing")
    commands.views.show("image")
    until(lambda: commands.presenter.overlay.tables is not None, "the sky")
    view, solution = window.workspace.view, commands.session.known.result
    x, y = solution.pixels_of(finder().still("M 42").vector[None])[0]
    pause(500)
    hand = Hand()
    at = QPoint(*np.round(view.viewport.to_screen(np.array([[x, y]]))[0]).astype(int).tolist())
    hand.clicks += 1
    QApplication.sendEvent(view, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, view.mapToGlobal(at)))
    until(lambda: isinstance(QApplication.activePopupWidget(), QMenu), "the menu")
    hand.choose(QApplication.activePopupWidget(), "Centre")
    until(lambda: control.known.busy, "the centring")
    until(lambda: not control.known.busy, "the end of the centring")
    target = tuple(float(part) for part in commands.views.docks["mount"].view.go.target.text().split())
    away = apart_deg(STARTED[-1].rig.truth().ra_dec_deg, target) * 3600.0
    hand.told("an object centred", off_arcsec=round(away, 1))


def aligned(window, commands):
    hand = Hand()
    hand.click(window.rail.widgetForAction(commands.actions["polar"]))
    view = commands.views.docks["polar"].view
    until(view.buttons.start.isVisible, "the view")
    view.setup.frames.exposure.setValue(1.0)
    hand.click(view.buttons.start)
    obeyed, motions, limit, practice = [], [], time.monotonic() + 400.0, None
    while not view.buttons.start.isVisible() and time.monotonic() < limit:
        pause(30)
        practice = view.alignment.adjuster._practice if view.alignment.adjuster is not None else practice
        asked = view.alignment.state.turn_instruction or view.alignment.state.instruction
        if (
            view.alignment.state.hand_needed
            and view.alignment.adjuster is not None
            and not any(asked is one for one in obeyed)
        ):
            obeyed.append(asked)
            bolt = view.alignment.state.turn_instruction is None
            motion = (asked.knob, asked.turns > 0.0) if bolt else (asked.direction, len(obeyed))
            if motion not in motions[-1:]:  # a bolt that goes on the same way is one thing to do
                motions.append(motion)
            view.buttons.turn_for_me.click()
    error = None if practice is None else round(practice.rig.truth().axis_error().total_arcsec, 1)
    hand.told("polar alignment", instructions=len(motions), sentences=len(obeyed), true_arcsec=error)


def main(folder=None, *only):
    app = QApplication([])
    QApplication.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs)
    with tempfile.TemporaryDirectory() as home:
        sample = {s.path.name: s.path for s in samples()}
        files = [Path(shutil.copy(path, f"{home}/{k}-{path.name}")) for k in range(2) for path in sample.values()]
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        steps = {
            "image": (practise, lambda w, c: own_image(w, c, files)),
            "ten": (practise, lambda w, c: ten_images(w, c, files)),
            "centred": (practise, lambda w, c: centred(w, c, sample["orion.png"])),
            "polar": (night(4.0), aligned),
        }
        for name in only or steps:
            start, task = steps[name]
            window, commands = build(WorkflowEngine(), settings, [], wiring=Wiring(practice=start))
            window.resize(1360, 860)
            window.show()
            window.activateWindow()
            pause(500)
            task(window, commands)
            if folder is not None:
                pause(400)
                keep(window, Path(folder) / f"{name}.png")
            window.close()
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
