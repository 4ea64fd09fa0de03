"""INDI drivers that never ask their mount: the place they tell is the last one they heard, however long ago."""

from pathlib import PurePath
from time import monotonic

from kochab.core.attitude import Degrees, apart_deg, wrapped
from kochab.core.mount import SIDEREAL_DEG_S
from kochab.gear.servers.indi_link import IndiDevice

ONLY_LISTEN = frozenset(("indi_bresserexos2",))
"""Programs of such drivers. While its mount tracks, this one tells nothing new: INDI drops what differs so little."""
NEWS_S = 5.0  # several reports of a mount that tells its place once a second
NEWS_DEG = 5.0 / 3600.0  # in a third of a second a mount that does not track drifts by more; what INDI drops is less
NEAR_DEG = 0.05  # beside drifting; a mount that was switched off and on is farther away


def only_listens(device: IndiDevice) -> bool:
    """Whether the device's driver never asks its mount where it is."""
    return PurePath(device.value("DRIVER_INFO", "DRIVER_EXEC") or "").name in ONLY_LISTEN


class LastHeard:
    """The last place that a driver told which its mount must have sent, RA and Dec in degrees, and when."""

    def __init__(self, device: IndiDevice, vector: str) -> None:
        self._device, self._vector = device, vector
        self._place_deg = self._told_deg()
        self.at_s = monotonic()  # or when it began to be looked at
        self.deaf = False  # it was seen to hear nothing any more

    def look(self) -> bool:
        """Whether it has told of another place since the last look that found one."""
        place = self._told_deg()
        if place is None:
            return False
        before = self._place_deg
        if before is not None and max(abs(wrapped(place[0] - before[0])), abs(place[1] - before[1])) < NEWS_DEG:
            return False
        self._place_deg, self.at_s, self.deaf = place, monotonic(), False
        return True

    def news(self, within_s: float) -> bool:
        """Whether it tells of another place in time."""
        return self._device.link.wait(self.look, within_s)

    def jumped_deg(self, before: "tuple[Degrees | None, float]") -> float:
        """How far it has come since an earlier :meth:`mark`; 0.0 for no more than a mount that stands or tracks."""
        (place, at_s), here = before, self._place_deg
        if place is None or here is None:
            return 0.0
        moved = apart_deg(place, here)
        return moved if moved > NEAR_DEG + 2.0 * SIDEREAL_DEG_S * (monotonic() - at_s) else 0.0

    def mark(self) -> "tuple[Degrees | None, float]":
        """The place, and when that was the last one known."""
        return self._place_deg, self.at_s

    def _told_deg(self) -> Degrees | None:
        ra, dec = (self._device.number(self._vector, member) for member in ("RA", "DEC"))
        return None if ra is None or dec is None else (ra * 15.0, dec)
