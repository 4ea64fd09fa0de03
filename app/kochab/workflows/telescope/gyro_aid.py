"""A phone's gyroscope beside the live solves: a phone clamped to the tube, and no encoders.

:mod:`kochab.pointing.gyro` aligns it. It is told as off when a solve contradicts it: the phone slid in its clamp.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from datetime import datetime
from time import monotonic

from kochab.core.arrays import Floats
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.gear.phone_gyro import PhoneGyro
from kochab.pointing.gyro import GyroModel
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr
from kochab.workflows.telescope.aid import PointingAid
from kochab.workflows.telescope.encoder_aid import FRESH_S, EncoderAid

PHONE = "http://"
"""Addresses that begin with this are phones; all others are encoder boxes."""


class GyroAid(PointingAid[PhoneGyro]):
    """Reads the phone in a thread of its own until :meth:`stop`.

    Parameters
    ----------
    address : str
        Of the phone, as phyphox shows it: ``http://HOST:PORT``.
    tell : Callable[[str], None]
        Takes each sentence for the person, in any thread.
    now : Callable[[], datetime]
        The time, UTC.
    site : Site or None
        Where it stands; None: not known, which costs little: refraction between two solves.
    """

    def __init__(
        self, address: str, tell: Callable[[str], None], now: Callable[[], datetime], site: Site | None = None
    ) -> None:
        self._address = address
        self.first_step = tr(
            "The phone's gyroscope is connected. Fix the phone to the tube; solve three frames some degrees apart, "
            "along both axes."
        )
        self.answers_again = tr("The phone answers again.")
        self._model = GyroModel()
        self._ahead_s = 0.0
        super().__init__(tell, now, site)

    def see(self, solution: Solution, at_s: float) -> None:
        """Align with a frame whose mid-exposure was ``at_s`` of :func:`time.monotonic`, unless it moved then."""
        with self.lock:
            off = self._model.see(self.earth_fixed(solution, at_s), at_s - self._ahead_s)
        if off is not None:
            self.say(
                tr(
                    "The gyroscope was {angle} off: the phone slid, or was turned too fast. Aligned again by this "
                    "frame.",
                    angle=angle_text(off),
                )
            )

    def _attitude(self) -> tuple[Floats, float, float] | None:
        attitude, newest = self._model.attitude(), self._model.newest
        if attitude is None or newest is None or monotonic() - newest.at_s - self._ahead_s > FRESH_S:
            return None
        return attitude, self._model.sigma_deg(), newest.at_s + self._ahead_s

    def _opened(self) -> AbstractContextManager[PhoneGyro]:
        return closing(PhoneGyro(self._address))

    def _look(self, device: PhoneGyro) -> None:
        felt = device.rates()
        with self.lock:
            if felt.anew:
                self._model.lose()
            if len(felt.at_s):
                self._ahead_s = felt.ahead_s
                self._model.feel(felt.at_s, felt.rates)
            rests = self._model.rate_deg_s == 0.0
        if rests:
            device.renew()

    def _lose(self) -> None:
        self._model.lose()


def pointing_aid(
    address: str, tell: Callable[[str], None], now: Callable[[], datetime], site: Site | None = None
) -> EncoderAid | GyroAid:
    """The aid at an address, begun.

    Parameters
    ----------
    address : str
        A phone's is ``http://HOST:PORT``, any other a box of encoders.
    tell : Callable[[str], None]
        Takes each sentence for the person, in any thread.
    now : Callable[[], datetime]
        The time, UTC.
    site : Site or None
        Where it stands; None: not known.
    """
    kind = GyroAid if address.startswith(PHONE) else EncoderAid
    return kind(address, tell, now, site)
