"""Cameras and solvers for the live tests: they do what they are told and count what they do."""

import threading
import time
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import LineLostError, RefusedError
from kochab.core.frame import Frame, Hint
from kochab.core.progress import Progress
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.solver.tracker import TrackUpdate

CAMERA = Camera.centred(600, 400, 3000.0)


class Clockwork(CameraSource):
    """Gives a numbered frame every ``every_s``; unplugged after ``frames``, which may be set while it runs."""

    name = "clockwork"

    def __init__(self, every_s=0.0, frames=None, hint=None, size=(40, 60)):
        self.every_s, self.frames, self.hint, self.size = every_s, frames, hint or Hint(), size
        self.given = 0
        self.closed = 0
        self.threads = set()
        self.settings = CaptureSettings(exposure_s=1.0)

    @property
    def limits(self):
        return CaptureLimits(exposure_s=(0.001, 30.0))

    def configure(self, settings):
        self.threads.add(threading.get_ident())
        if settings.exposure_s is not None:
            if settings.exposure_s > 30:
                raise RefusedError("The camera exposes at most 30 s.")
            self.settings = replace(self.settings, exposure_s=settings.exposure_s)
        return self.settings

    def next_frame(self, timeout_s):
        self.threads.add(threading.get_ident())
        if self.frames is not None and self.given >= self.frames:
            raise LineLostError("The camera was unplugged.")
        time.sleep(min(self.every_s, timeout_s))
        self.given += 1
        return Frame(np.full(self.size, self.given % 65536, np.uint16), hint=self.hint)

    def close(self):
        self.threads.add(threading.get_ident())
        self.closed += 1


def solution(ra_deg=80.0, dec_deg=20.0, roll_deg=0.0):
    return Solution(CAMERA, attitude_from(ra_deg, dec_deg, roll_deg), (), 0.1, -30.0, "told")


def refusal():
    return NoSolution(Reason.CLOUDED_OR_DARK, "Wait for the clouds to pass.")


class Told:
    """Answers what ``answer(number)`` says of the frame's number, after ``slow_s``."""

    profile = None
    kept = 0

    def __init__(self, answer=lambda number: solution(), slow_s=0.0):
        self.answer, self.slow_s = answer, slow_s
        self.seen = []

    def update(self, frame, time_utc=None):
        yield Progress("detect", 0.1)
        time.sleep(self.slow_s)
        number = int(frame.pixels[0, 0])
        self.seen.append(number)
        found = self.answer(number)
        moment = time_utc or datetime.now(UTC)
        if isinstance(found, Solution):
            return TrackUpdate(moment, "tracking", found, None)
        return TrackUpdate(moment, "lost", None, found)

    def keep(self):
        self.kept += 1


def posted(live, post):
    """The same as a plain task: updates go to ``post``."""
    try:
        while True:
            try:
                step = next(live)
            except StopIteration as end:
                return end.value
            if isinstance(step, Progress):
                yield step
            else:
                post(step)
                yield Progress("solved", None, f"frame {step.shot.number}")
    finally:
        live.close()
