"""Counts what a polar alignment of the practice telescope costs a person, through the real window.

``python -m tests.window.polar_clicks [--rate N] [--pictures FOLDER] [--size WxH] [--theme NAME] [--seed N]`` begins
an alignment 47 arcmin from the pole with a mount that is as good as its practice hands, presses the one button that is
offered whenever it can be pressed, and prints clicks, seconds of the window and of the sky, and the true error at the
end. ``--pictures`` keeps the window at every step; ``QT_SCALE_FACTOR=2`` is 200 %.
"""

import argparse
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication, QWidget

from kochab.core.frame import Site
from kochab.server.phone_page import PhonePage
from kochab.simulate.practice import PracticeNight
from kochab.simulate.rig import misaligned, through, tonight
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.settings import WindowSettings
from kochab.workflows.session.wiring import Wiring
from tests.window.take_screenshots import keep, pause

BEGINS_ARCMIN, SITE, LIMIT_S = 47.0, Site(47.0, 8.0, 450.0), 900.0


def nights(rate, seed):
    """Starts practice nights of a mount without wear."""

    def start(fov_deg):
        rig = through(misaligned(tonight(seed, SITE), BEGINS_ARCMIN), fov_deg)
        return PracticeNight(replace(rig, rate=rate))

    return start


def can_be_pressed(made):
    """Whether a person sees the button, and it is not greyed."""
    return made.isVisible() and made.isEnabled()


def align(view, step=lambda name: None):
    """Press what is offered until the alignment is over; clicks, seconds, and the error that is true in the end."""
    clicks, begun, practice = 1, time.monotonic(), None
    view.buttons.start.click()
    asked_before = None
    while not can_be_pressed(view.buttons.start) and time.monotonic() - begun < LIMIT_S:
        pause(50)
        if view.alignment.adjuster is not None:
            practice = view.alignment.adjuster._practice
        asked = view.alignment.state.turn_instruction or view.alignment.state.instruction
        if not view.alignment.state.hand_needed or not can_be_pressed(view.buttons.turn_for_me):
            continue
        if asked is asked_before:
            continue
        asked_before = asked
        print(f"{time.monotonic() - begun:6.1f} s  {view.alignment.state.words}", file=sys.stderr)
        step(f"{clicks:02d}")
        view.buttons.turn_for_me.click()
        clicks += 1
        pause(150)
        step(f"{clicks:02d}-turned")
    seconds = time.monotonic() - begun
    pause(300)
    step("end")
    true = None if practice is None else practice.rig.truth().axis_error().total_arcsec
    return {
        "clicks": clicks,
        "seconds": round(seconds, 1),
        "true_arcsec": true,
        "stage": view.alignment.state.stage,
        "said": view.alignment.state.words,
    }


def main(arguments):
    parser = argparse.ArgumentParser()
    parser.add_argument("--rate", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--size", default="1366x768")
    parser.add_argument("--theme", default="dark")
    asked = parser.parse_args(arguments)
    app = QApplication([])
    with tempfile.TemporaryDirectory() as home:
        settings = WindowSettings(QSettings(f"{home}/window.ini", QSettings.Format.IniFormat))
        wiring = Wiring(practice=nights(asked.rate, asked.seed), phone_page=PhonePage)
        window, commands = build(WorkflowEngine(), settings, [], wiring=wiring)
        width, height = map(int, asked.size.split("x"))
        window.resize(width, height)
        window.show()
        commands.appearance.use_theme(asked.theme)
        while not commands.appearance.settled:
            pause(50)
        commands.views.show("polar")
        pause(300)
        view = commands.views.docks["polar"].view
        view.setup.aim.imaging.setText("600 mm, 3.76 µm, 300 s")

        def step(name):
            if asked.pictures is not None:
                asked.pictures.mkdir(parents=True, exist_ok=True)
                keep(window, asked.pictures / f"{name}.png")

        step("00-idle")
        print(json.dumps(align(view, step) | {"rate": asked.rate, "seed": asked.seed}))
        assert isinstance(window, QWidget)
        window.close()
    app.quit()


if __name__ == "__main__":
    main(sys.argv[1:])
