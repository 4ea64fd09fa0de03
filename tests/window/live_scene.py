"""Take the picture of the Live view: ``python -m tests.window.live_scene FOLDER`` saves ``live.png``.

A finder camera on a simulated mount is slewed about and comes to rest.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication

from kochab.__main__ import _to_record
from kochab.core.capture import CaptureSettings
from kochab.core.mount import Direction
from kochab.simulate.camera_source import SimulatedCamera
from kochab.simulate.rig import PracticeRig, through, tonight
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.workflows.session.live_stream import StreamRequest
from kochab.workflows.session.wiring import Wiring
from tests.window.take_screenshots import keep, pause

LIMIT_S = 60.0
PATH = ((Direction.EAST, 8.0), (Direction.NORTH, 4.0), (Direction.WEST, 5.0))


def until_tracking(view):
    end = time.monotonic() + LIMIT_S
    pause(1500)
    while view.title.text() != "Tracking" and time.monotonic() < end:
        pause(200)


def play(commands):
    """Run the camera, slew its mount along a path, and come to rest; the view and the rig."""
    config = through(tonight(3), 8.0)
    rig = PracticeRig(replace(config, camera=replace(config.camera, zero_point_e_s=1e8, cheap=True)))
    commands.views.show("live")
    view = commands.views.docks["live"].view
    source = SimulatedCamera(rig, CaptureSettings(0.2))
    view.run(StreamRequest(lambda: source, "a finder of 8 degrees"))
    until_tracking(view)
    for direction, seconds in PATH:
        rig.mount.move(direction, 3.0)
        pause(round(1000 * seconds))
        rig.mount.halt()
        until_tracking(view)
    pause(4000)
    return view, rig


def main(folder):
    app = QApplication([])
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(WorkflowEngine(), settings, [], Wiring(to_record=_to_record))
        window.resize(1360, 860)
        window.show()
        view, _ = play(commands)
        view.record.use_folder(Path("Kochab"))
        pause(300)
        keep(window, Path(folder, "live.png"))
        print(view.title.text())
        window.close()
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
