"""Take the pictures of the window that the README shows, on whatever screen there is.

``python -m tests.ui.take_screenshots FOLDER [FRAME]`` (the README's are in
``resources/screenshots``) opens the frame in the real window with the real engine and saves
``window.png``, ``night.png`` and ``welcome.png``; it prints what Qt drew on and what was found.
"""

import json
import sys
import tempfile
from pathlib import Path

from PIL import Image
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from app.core.solution import Solution
from app.ui.application import build
from app.ui.engine import WorkflowEngine
from app.ui.samples import samples
from app.ui.settings import Settings

LIMIT_MS = 90_000


def pause(ms):
    loop = QEventLoop()
    QTimer.singleShot(ms, loop.quit)
    loop.exec()


def keep(window, path):
    """Save what the window shows, as small as PNG makes it."""
    window.grab().save(str(path))
    with Image.open(path) as picture:
        small = picture.convert("RGB")
    small.save(path, optimize=True)


def main(folder, frame=None):
    app = QApplication([])
    folder = Path(folder)
    with tempfile.TemporaryDirectory() as home:
        settings = Settings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings)
        window.resize(1360, 860)
        window.show()
        window.activateWindow()
        commands.add_thumbnails()
        pause(1500)
        keep(window, folder / "welcome.png")
        loop = QEventLoop()
        commands.session.idle.connect(loop.quit)
        QTimer.singleShot(LIMIT_MS, loop.quit)
        path = frame or next(s.path for s in samples() if "pleiades" in s.path.name)
        commands.open(Path(path))
        loop.exec()
        pause(300)
        keep(window, folder / "window.png")
        commands.actions["night"].trigger()
        pause(300)
        keep(window, folder / "night.png")
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
