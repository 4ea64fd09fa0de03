"""Encoders between live solves: the arrow follows the telescope. :mod:`kochab.pointing.encoders` aligns them."""

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from datetime import datetime
from time import monotonic

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.gear.encoders import EncoderBox
from kochab.pointing.encoders import Counts, EncoderModel
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr
from kochab.workflows.telescope.aid import PointingAid

KEPT_S = 60.0
"""Seconds from mid-exposure within which a frame is solved."""
FRESH_S = 1.5
STILL_S, STILL_COUNTS = 1.0, 2.5
"""A frame is of one place when the counts have not changed for so long about its mid-exposure, but for a flicker."""


class EncoderAid(PointingAid[EncoderBox]):
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
        self._port = port
        self.first_step = tr("Encoders connected. Solve two frames some degrees apart along both axes.")
        self.answers_again = tr("The encoders answer again.")
        if site is None:
            self.first_step += " " + tr(
                "No site is set: the axes are taken as polar aligned. For a Dobsonian, set your site."
            )
        self._model = EncoderModel(None if site is None else site.latitude_deg)
        self._aligned_s: float | None = None
        self._looks: deque[tuple[float, Counts]] = deque()
        super().__init__(tell, now, site)

    def see(self, solution: Solution, at_s: float) -> None:
        """Align with a frame whose mid-exposure was ``at_s`` of :func:`time.monotonic`, unless it moved then."""
        with self.lock:
            near = [counts for when, counts in self._looks if abs(when - at_s) <= STILL_S]
            if not near or np.ptp(near, axis=0).max() > STILL_COUNTS:
                return  # it moved, or nobody looked
            off = self._model.see(self.earth_fixed(solution, at_s), near[len(near) // 2], self._since(at_s))
            known, self._aligned_s = self._aligned_s is not None, at_s
        if off is not None and known:
            self.say(
                tr(
                    "The encoders were {angle} off: they slipped or were reset. Aligned again by this frame.",
                    angle=angle_text(off),
                )
            )

    def _attitude(self) -> tuple[Floats, float, float] | None:
        if self._aligned_s is None or not self._looks or monotonic() - self._looks[-1][0] > FRESH_S:
            return None
        at_s, counts = self._looks[-1]
        attitude = self._model.attitude(counts)
        return None if attitude is None else (attitude, self._model.sigma_deg(counts, self._since(at_s)), at_s)

    def _since(self, at_s: float) -> float:
        return 0.0 if self._aligned_s is None else max(0.0, at_s - self._aligned_s)

    def _opened(self) -> AbstractContextManager[EncoderBox]:
        return closing(EncoderBox(self._port))

    def _look(self, device: EncoderBox) -> None:
        look = (monotonic(), device.counts())
        with self.lock:
            self._looks.append(look)
            while look[0] - self._looks[0][0] > KEPT_S:
                self._looks.popleft()

    def _lose(self) -> None:
        self._aligned_s = None
        self._looks.clear()
