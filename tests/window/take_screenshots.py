"""Take the pictures of the window that the README shows, on whatever screen there is.

``python -m tests.window.take_screenshots FOLDER [FRAME] [--laboratory] [--plain]`` (the README's are in
``resources/screenshots``) opens the frame in the real window with the real engine and saves
``window.png``, ``night.png`` and ``welcome.png``, and with ``--laboratory`` also that view after a
comparison and curves of a minute or so; it prints what Qt drew on and what was found. ``--plain`` pictures are
as large as they come: to make them small is a third of the work.
The picture of the Mount view is ``mount.png`` of :mod:`tests.window.practice_on_screen`.
"""

import json
import sys
import tempfile
from pathlib import Path

from PIL import Image
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from kochab.__main__ import _practise
from kochab.core.solution import Solution
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.window.shell.welcome import samples
from kochab.workflows.session.wiring import Wiring

LIMIT_MS = 90_000


def pause(ms):
    loop = QEventLoop()
    QTimer.singleShot(ms, loop.quit)
    loop.exec()


def keep(window, path, plain=False):
    """Save what the window shows in 256 colours, which keeps the repository small; ``plain`` as Qt has it."""
    if plain:
        window.grab().save(str(path), quality=80)
        return
    window.grab().save(str(path))
    with Image.open(path) as picture:
        red, green, blue = picture.convert("RGB").split()
    if green.getextrema() == blue.getextrema() == (0, 0):  # night: one shade of red in five
        small = red.point([round(shade / 5) * 5 for shade in range(256)])
        small.putpalette([value for shade in range(256) for value in (shade, 0, 0)])
    else:
        whole = Image.merge("RGB", (red, green, blue))
        rare_too = Image.Quantize.MAXCOVERAGE  # others forget the few pixels of a mark
        small = whole.quantize(256, method=rare_too, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


def show_laboratory(commands, path):
    """Compare every method, draw the curves of three, and keep the picture."""
    commands.views.show("laboratory")
    commands.actions["fill"].trigger()
    view = commands.views.docks["laboratory"].view
    for methods, run in ((None, view.run_comparison), (["patterns", "voting", "neighbours"], view.run_curves)):
        if methods:
            view.methods.tick(methods)
        run()
        while not view.compare.isEnabled():
            pause(200)
    view.methods.list.setCurrentRow(1)
    pause(500)
    keep(commands.window, path)
    commands.views.toggle("laboratory")


def main(folder, *arguments):
    frame, plain = next((a for a in arguments if not a.startswith("-")), None), "--plain" in arguments
    app = QApplication([])
    folder = Path(folder)
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        wiring = Wiring(practice=_practise)
        window, commands = build(WorkflowEngine(), settings, wiring=wiring)
        window.resize(1360, 860)
        window.show()
        window.activateWindow()
        commands.window.welcome.load_pictures(commands.session.jobs, lambda: commands.looks.is_night)
        for _ in range(60):  # on a busy machine they take a while
            pause(500)
            if not any(made.icon().isNull() for made in window.welcome.samples):
                break
        pause(700)  # until they are laid out
        keep(window, folder / "welcome.png", plain)
        loop = QEventLoop()
        commands.session.idle.connect(loop.quit)
        QTimer.singleShot(LIMIT_MS, loop.quit)
        path = frame or next(s.path for s in samples() if "pleiades" in s.path.name)
        commands.files.open(Path(path))
        loop.exec()
        while commands.presenter.overlay.tables is None or window.workspace.card.title.text() == "Solved":
            pause(100)  # until the sky is drawn and the field has its name
        pause(300)
        keep(window, folder / "window.png", plain)
        if "--laboratory" in arguments:
            show_laboratory(commands, folder / "laboratory.png")
        commands.actions["night"].trigger()
        while not commands.appearance.settled:
            pause(100)
        pause(300)
        keep(window, folder / "night.png", plain)
        result = commands.session.known.result
        told = {"platform": QGuiApplication.platformName(), "solved": isinstance(result, Solution)}
        if isinstance(result, Solution):
            told["ra_deg"], told["dec_deg"] = result.ra_dec_deg
            told["stars"] = len(result.stars)
        print(json.dumps(told))
        window.close()
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
