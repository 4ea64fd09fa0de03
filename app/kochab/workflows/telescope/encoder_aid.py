"""Encoders beside the live solves: the arrow moves with the hands, between one solved frame and the next.

Each solve that stood still aligns the encoders anew (:mod:`kochab.pointing.encoders`). A box that is silent, sends
garbage or lost its cable is told once, and the solves alone show the way until it is back.
"""

import threading
from collections import deque
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime, timedelta
from time import monotonic

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, radec_deg
from kochab.core.errors import DeviceError, NoAnswerError
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.gear.encoders import EncoderBox
from kochab.pointing.encoders import Counts, EncoderModel, earth_fixed
from kochab.sky.horizon import NO_AIR, STANDARD_REFRACTION, Horizon
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr

EVERY_S, AGAIN_S, JOIN_S = 0.1, 3.0, 6.0
KEPT_S = 60.0
"""Seconds from mid-exposure within which a frame is solved."""
FRESH_S = 1.5
STILL_S, STILL_COUNTS = 1.0, 2.5
"""A frame is of one place when the counts have not changed for so long about its mid-exposure, but for a flicker."""
MOST_SIGMA_DEG = 2.0
"""Degrees of 1 sigma: when less certain, the encoders report no position."""
BESIDE_RAD = 1e-3


@dataclass(frozen=True, slots=True)
class ByEncoders:
    """Where it points by the counts: ICRS degrees, 1 sigma, and when, of :func:`time.monotonic`."""

    icrs_deg: Degrees
    sigma_deg: float
    at_s: float


class EncoderAid:
    """Reads the box in a thread of its own until :meth:`stop`.

    Parameters
    ----------
    port : str
        Where the box is: a serial port or ``tcp://HOST:PORT``.
    tell : Callable[[str], None]
        Takes each sentence for the person, in any thread.
    now : Callable[[], datetime]
        The time, UTC.
    site : Site or None
        Where it stands; None: not known, and the mount is taken for a polar aligned one.
    """

    def __init__(
        self, port: str, tell: Callable[[str], None], now: Callable[[], datetime], site: Site | None = None
    ) -> None:
        self._port, self._tell, self._now = port, tell, now
        # At the pole the Earth's axis is up: hour angle and declination are azimuth and altitude.
        self._site, self._air = (Site(90.0, 0.0), NO_AIR) if site is None else (site, STANDARD_REFRACTION)
        self._without_site = site is None
        self._model = EncoderModel(None if site is None else site.latitude_deg)
        self._aligned_s: float | None = None
        self._looks: deque[tuple[float, Counts]] = deque()
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="kochab-encoders", daemon=True)
        self._thread.start()

    def stop(self, wait_s: float = JOIN_S) -> None:
        """Tell nothing more and give the port back; returns when that is done, or after ``wait_s``."""
        self._over.set()
        self._thread.join(wait_s)

    def _say(self, sentence: str) -> None:
        if not self._over.is_set():
            self._tell(sentence)

    def _say_lost(self, error: DeviceError) -> None:
        self._say(tr("{why} For now only solved frames show the way.", why=error))

    # -- What is seen ------------------------------------------------------------------------------

    def see(self, solution: Solution, at_s: float) -> None:
        """Align with a frame whose mid-exposure was ``at_s`` of :func:`time.monotonic`."""
        with self._lock:
            near = [counts for when, counts in self._looks if abs(when - at_s) <= STILL_S]
            if not near or np.ptp(near, axis=0).max() > STILL_COUNTS:
                return  # it moved, or nobody looked
            off = self._model.see(self._earth_fixed(solution, at_s), near[len(near) // 2], self._since(at_s))
            known, self._aligned_s = self._aligned_s is not None, at_s
        if off is not None and known:
            self._say(
                tr(
                    "The encoders were {angle} off: they slipped or were reset. Aligned again by this frame.",
                    angle=angle_text(off),
                )
            )

    def pointing(self, eyepiece: Floats) -> ByEncoders | None:
        """Where a direction (3,) in camera axes points now; None while the encoders cannot tell."""
        with self._lock:
            if self._aligned_s is None or not self._looks or monotonic() - self._looks[-1][0] > FRESH_S:
                return None
            at_s, counts = self._looks[-1]
            sigma, attitude = self._model.sigma_deg(counts, self._since(at_s)), self._model.attitude(counts)
        if attitude is None or sigma > MOST_SIGMA_DEG:
            return None
        return ByEncoders(radec_deg(self._horizon(at_s).catalogue(eyepiece @ attitude)[0]), sigma, at_s)

    def _since(self, at_s: float) -> float:
        return 0.0 if self._aligned_s is None else max(0.0, at_s - self._aligned_s)

    def _horizon(self, at_s: float) -> Horizon:
        return Horizon(self._site, self._now() - timedelta(seconds=monotonic() - at_s), self._air)

    def _earth_fixed(self, solution: Solution, at_s: float) -> Floats:
        axes = solution.centre_attitude.matrix
        toward_x = axes[2] + BESIDE_RAD * axes[0]
        return earth_fixed(self._horizon(at_s).observed(np.stack([axes[2], toward_x / np.linalg.norm(toward_x)])))

    # -- The box -----------------------------------------------------------------------------------

    def _run(self) -> None:
        last_error = ""
        while not self._over.is_set():
            try:
                with closing(EncoderBox(self._port)) as box:
                    last_error = ""
                    self._say(self._next_step())
                    self._read(box)
            except DeviceError as error:
                if str(error) != last_error:
                    self._say_lost(error)
                last_error = str(error)
            with self._lock:
                self._aligned_s = None  # what turned meanwhile, nobody counted: the next solve tells
                self._looks.clear()
            self._over.wait(AGAIN_S)

    def _next_step(self) -> str:
        text = tr("Encoders connected. Solve two frames some degrees apart along both axes.")
        if self._without_site:
            text += " " + tr("No site is set: the axes are taken as polar aligned. For a Dobsonian, set your site.")
        return text

    def _read(self, box: EncoderBox) -> None:
        """Look until it is over or the line is gone; an answer that makes no sense is told when it is not the last."""
        is_lost = False
        while not self._over.wait(EVERY_S):
            try:
                look = (monotonic(), box.counts())
            except NoAnswerError as error:
                if not is_lost:
                    self._say_lost(error)
                is_lost = True
                continue
            if is_lost:
                self._say(tr("The encoders answer again."))
                is_lost = False
            with self._lock:
                self._looks.append(look)
                while look[0] - self._looks[0][0] > KEPT_S:
                    self._looks.popleft()
