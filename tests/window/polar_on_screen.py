"""A polar alignment on the practice telescope in the real window, with pictures of its way.

``python -m tests.window.polar_on_screen FOLDER [--night] [--light] [--rate N]`` measures, obeys the
tutor, measures again, and saves ``polar.png`` (the bolts are being turned) and ``bolts.png`` (the
view at the bolts, which the README shows), ``setup.png``, ``tonight.png`` and ``phone.png``; it
prints what the axis is said to be and what it is. ``QT_SCALE_FACTOR=2`` is 200 %.
"""

import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication

from kochab.core.frame import Site
from kochab.server.phone_page import PhonePage
from kochab.simulate.practice import PracticeNight
from kochab.simulate.rig import misaligned, through, tonight
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.workflows.session.wiring import Wiring
from tests.window.take_screenshots import keep, pause

LIMIT_S = 400
PICTURED_TURN = 3  # the instruction in whose middle the pictures are taken
BOLTS_PX = (1360, 765)


def night(rate):
    """Starts practice nights of a mount without wear, 40 arcmin off."""

    def start(fov_deg):
        rig = through(misaligned(tonight(3, Site(47.0, 8.0, 450.0)), 40.0), fov_deg)
        return PracticeNight(replace(rig, rate=rate))

    return start


def align(view, pictured):
    """Obey every instruction; the true error at the end, arcsec. ``pictured`` is called once."""
    obeyed, turns, practice = [], 0, None
    begun = time.monotonic()
    view.begin()
    while view.buttons.start.isHidden() and time.monotonic() - begun < LIMIT_S:
        pause(30)
        if view.alignment.adjuster is not None:
            practice = view.alignment.adjuster._practice
        asked = view.alignment.state.turn_instruction or view.alignment.state.instruction
        known = any(asked is one for one in obeyed)  # equal asks recur
        if not view.alignment.state.hand_needed or known or view.alignment.adjuster is None:
            continue
        obeyed.append(asked)
        turns += view.alignment.state.instruction is not None
        if turns == PICTURED_TURN:
            pause(400)
            pictured()
            turns += 1
        view.buttons.turn_for_me.click()
    return None if practice is None else practice.rig.truth().axis_error().total_arcsec


def main(folder, *arguments):
    app = QApplication([])
    folder = Path(folder)
    rate = float(arguments[arguments.index("--rate") + 1]) if "--rate" in arguments else 4.0
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        window, commands = build(
            WorkflowEngine(), settings, [], wiring=Wiring(practice=night(rate), phone_page=PhonePage)
        )
        window.resize(1360, 860)
        window.show()
        theme = "night" if "--night" in arguments else "light" if "--light" in arguments else "dark"
        commands.appearance.use_theme(theme)
        while not commands.appearance.settled:
            pause(50)
        commands.views.show("polar")
        view = commands.views.docks["polar"].view
        view.setup.frames.exposure.setValue(1.0)
        view.setup.aim.imaging.setText("600 mm, 3.76 µm, 300 s")
        pause(300)
        keep(window, folder / "setup.png")

        def pictured():
            keep(window, folder / "polar.png")
            view.show_bolts()
            view.bolts.showNormal()
            view.bolts.resize(*BOLTS_PX)
            pause(200)
            keep(view.bolts, folder / "bolts.png")
            view.bolts.close()

        true_arcsec = align(view, pictured)
        view.tabs.setCurrentIndex(2)
        pause(300)
        keep(window, folder / "tonight.png")
        view.phone._host = "127.0.0.1"
        view.tabs.setCurrentIndex(3)
        view.phone.switch.setChecked(True)
        pause(2000)
        keep(window, folder / "phone.png")
        error = view.alignment.state.error
        told = {"stage": view.alignment.state.stage, "said": view.alignment.state.words}
        told["true_arcsec"] = true_arcsec
        told["said_arcsec"] = None if error is None else error.total_arcsec
        print(json.dumps(told))
        window.close()
    app.quit()


if __name__ == "__main__":
    main(*sys.argv[1:])
