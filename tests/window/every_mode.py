"""Take every mode of the window at the sizes, scales and themes people have, as sheets to look at.

``python -m tests.window.every_mode FOLDER [--frame FRAME]`` runs itself once a scale (Qt takes it at start), on the
virtual screen unless ``QT_QPA_PLATFORM`` names another, and saves a sheet a theme and size: every mode in it, and below
each what does not fit its screen. A single picture is ``THEME-WIDTHxHEIGHT-SCALE-MODE.png`` in ``FOLDER/one``.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from kochab.__main__ import _practise, _to_record
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.window.shell.welcome import samples
from kochab.workflows.session.wiring import Wiring
from tests.window.take_screenshots import LIMIT_MS, pause

SCALES = (1.0, 1.5, 2.0)
SIZES = ((1024, 700), (1366, 768), (1600, 1000), (3840, 2160))
"""Of the screen, in its own pixels."""
THEMES = ("dark", "light", "night")
MODES = ("image", "live", "polar", "mount", "laboratory")
TILE_PX = 900


def use(commands, theme):
    """Wear a theme and wait until every part of the window does."""
    commands.appearance.use_night(theme == "night")
    if theme != "night":
        commands.appearance.use_theme(theme)
    while not commands.appearance.settled:
        pause(50)


def take(folder, frame):
    """All pictures at the scale of this process."""
    app = QApplication([])
    scale = app.primaryScreen().devicePixelRatio()
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings, [], Wiring(practice=_practise, to_record=_to_record))
        window.show()
        loop = QEventLoop()
        commands.session.idle.connect(loop.quit)
        QTimer.singleShot(LIMIT_MS, loop.quit)
        commands.files.open(frame)
        loop.exec()
        for theme in THEMES:
            use(commands, theme)
            for width, height in SIZES:
                for mode in MODES:
                    asked = round(width / scale), round(height / scale)
                    commands.views.show(mode)
                    pause(50)  # until the window knows that it may be smaller now
                    window.resize(*asked)
                    pause(250)
                    window.grab().save(str(folder / f"{theme}-{width}x{height}-{scale:g}-{mode}.png"))
                    if window.width() > asked[0] or window.height() > asked[1]:
                        print(f"{mode} {theme} at {scale:g}: {window.width()}x{window.height()}, screen {asked}")
        window.close()
    app.quit()


def sheet(pictures, path):
    """Pictures side by side, each with its name."""
    columns = 2 if len(pictures) <= 4 else 3
    tiles = []
    for picture in pictures:
        with Image.open(picture) as whole:
            tile = whole.convert("RGB")
        tile.thumbnail((TILE_PX, TILE_PX))
        tiles.append((tile, picture.stem))
    height = max(tile.height for tile, _ in tiles) + 24
    made = Image.new("RGB", (columns * TILE_PX, math.ceil(len(tiles) / columns) * height), "#808080")
    draw = ImageDraw.Draw(made)
    for n, (tile, name) in enumerate(tiles):
        at = n % columns * TILE_PX, n // columns * height
        made.paste(tile, (at[0], at[1] + 24))
        draw.text((at[0] + 6, at[1] + 4), name, fill="black")
    made.save(path)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--frame", type=Path, help="the open frame (default: the sample of the Pleiades)")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    single = given.folder / "one"
    single.mkdir(parents=True, exist_ok=True)
    frame = given.frame or next(s.path for s in samples() if "pleiades" in s.path.name)
    if given.here:
        take(single, frame)
        return
    for scale in SCALES:
        environment = {"QT_QPA_PLATFORM": "offscreen", **os.environ, "QT_SCALE_FACTOR": f"{scale:g}"}
        again = [sys.executable, "-m", "tests.window.every_mode", str(given.folder), "--here", "--frame", str(frame)]
        subprocess.run(again, env=environment, check=True)
    for theme in THEMES:
        for width, height in SIZES:
            for scale in SCALES:
                part = f"{theme}-{width}x{height}-{scale:g}"
                sheet([single / f"{part}-{mode}.png" for mode in MODES], given.folder / f"{part}.png")


if __name__ == "__main__":
    main()
