"""What tells where a pushed telescope points between one solved frame and the next: encoders, or a gyroscope on it.

Each solve that stood still aligns it anew. One that is silent, sends garbage or lost its line is told once, and the
solves alone show the way until it is back.
"""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from datetime import datetime, timedelta
from time import monotonic
from typing import Generic, TypeVar

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, radec_deg, unit
from kochab.core.errors import DeviceError, NoAnswerError
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.pointing.encoders import earth_fixed
from kochab.sky.horizon import NO_AIR, STANDARD_REFRACTION, Horizon
from kochab.text.translation import tr

EVERY_S, AGAIN_S, JOIN_S = 0.1, 3.0, 6.0
MOST_SIGMA_DEG = 2.0
"""Above this uncertainty (1 sigma, degrees) no position is reported."""
BESIDE_RAD = 1e-3

Device = TypeVar("Device")


@frozen
class ByAid:
    """Where it points: ICRS degrees, 1 sigma, and when, of :func:`time.monotonic`."""

    icrs_deg: Degrees
    sigma_deg: float
    at_s: float


class PointingAid(ABC, Generic[Device]):
    """Asks a device in a thread of its own until :meth:`stop`.

    Parameters
    ----------
    tell : Callable[[str], None]
        Takes each sentence for the person, in any thread.
    now : Callable[[], datetime]
        The time, UTC.
    site : Site or None
        Where it stands; None: not known, and the Earth's axis is taken for up.
    """

    def __init__(self, tell: Callable[[str], None], now: Callable[[], datetime], site: Site | None) -> None:
        self._tell, self._now = tell, now
        # At the pole the Earth's axis is up: hour angle and declination are azimuth and altitude.
        self._site, self._air = (Site(90.0, 0.0), NO_AIR) if site is None else (site, STANDARD_REFRACTION)
        self.lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="kochab-aid", daemon=True)
        self._thread.start()

    def stop(self, wait_s: float = JOIN_S) -> None:
        """Tell nothing more and give the line back; returns when that is done, or after ``wait_s``."""
        self._over.set()
        self._thread.join(wait_s)

    @abstractmethod
    def see(self, solution: Solution, at_s: float) -> None:
        """Align with a frame whose mid-exposure was ``at_s`` of :func:`time.monotonic`."""

    def pointing(self, eyepiece: Floats) -> ByAid | None:
        """Where a direction (3,) in camera axes points now; None while that cannot be told."""
        with self.lock:
            found = self._attitude()
        if found is None or found[1] > MOST_SIGMA_DEG:
            return None
        attitude, sigma_deg, at_s = found
        return ByAid(radec_deg(self._horizon(at_s).catalogue(eyepiece @ attitude)[0]), sigma_deg, at_s)

    # -- What each kind is, called with the lock held but for `_opened` and `_look` ----------------------

    @abstractmethod
    def _attitude(self) -> tuple[Floats, float, float] | None:
        """From Earth-fixed directions to camera axes (3, 3), its 1 sigma in degrees, and of which moment."""

    @abstractmethod
    def _opened(self) -> AbstractContextManager[Device]:
        """The device; DeviceError without."""

    @abstractmethod
    def _look(self, device: Device) -> None:
        """Ask it once; `NoAnswerError` when it says nothing of use."""

    @abstractmethod
    def _lose(self) -> None:
        """What turned meanwhile, nobody noticed: the next solve tells."""

    first_step: str
    """What to do next; shown once the device is connected."""
    answers_again: str

    # -- What they share -----------------------------------------------------------------------------

    def say(self, sentence: str) -> None:
        """Tell the person, unless it is over."""
        if not self._over.is_set():
            self._tell(sentence)

    def earth_fixed(self, solution: Solution, at_s: float) -> Floats:
        """The attitude (3, 3) of a solve, from Earth-fixed directions."""
        axes = solution.centre_attitude.matrix
        toward_x = axes[2] + BESIDE_RAD * axes[0]
        return earth_fixed(self._horizon(at_s).observed(np.stack([axes[2], unit(toward_x)])))

    def _horizon(self, at_s: float) -> Horizon:
        return Horizon(self._site, self._now() - timedelta(seconds=monotonic() - at_s), self._air)

    def _say_lost(self, error: DeviceError) -> None:
        self.say(tr("{why} For now only solved frames show the way.", why=error))

    def _run(self) -> None:
        last_error = ""
        while not self._over.is_set():
            try:
                with self._opened() as device:
                    last_error = ""
                    self.say(self.first_step)
                    self._ask_again_and_again(device)
            except DeviceError as error:
                if str(error) != last_error:
                    self._say_lost(error)
                last_error = str(error)
            with self.lock:
                self._lose()
            self._over.wait(AGAIN_S)

    def _ask_again_and_again(self, device: Device) -> None:
        """Look until it is over or the line is gone; an answer that makes no sense is told when it is not the last."""
        is_lost = False
        while not self._over.wait(EVERY_S):
            try:
                self._look(device)
            except NoAnswerError as error:
                if not is_lost:
                    self._say_lost(error)
                is_lost = True
                continue
            if is_lost:
                self.say(self.answers_again)
                is_lost = False
