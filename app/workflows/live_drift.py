"""How fast the pointing wanders on the sky: a straight line through the last minute."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg

Floats = NDArray[np.float64]
ARCSEC = float(np.degrees(1.0) * 3600.0)
WINDOW_S = 60.0
MOST = 300
SLEW_ARCSEC_MIN = 3000.0
"""Faster than this between two frames the mount was moved: an untracked sky makes 902 at most."""
SLEW_ARCSEC = 60.0


@dataclass(frozen=True, slots=True)
class Drift:
    """Motion of the frame's centre on the sky, arcsec a minute; east and north are positive.

    ``ra`` is along right ascension and already multiplied by cos(Dec). The sigmas come from the
    scatter about the line, so wind and seeing widen them.
    """

    ra_arcsec_min: float
    dec_arcsec_min: float
    ra_sigma: float
    dec_sigma: float
    span_s: float
    frames: int


class DriftMeter:
    """Takes pointings and tells their drift over the last :data:`WINDOW_S`."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, Floats]] = deque(maxlen=MOST)

    def forget(self) -> None:
        """Begin anew, as after a slew."""
        self._points.clear()

    def add(self, time_s: float, centre: Floats) -> Drift | None:
        """Take the ICRS unit vector (3,) of a frame's centre at ``time_s``, any steady seconds.

        None until three frames in a row were solved without a slew between them.
        """
        if self._points and (time_s <= self._points[-1][0] or self._moved(time_s, centre)):
            self.forget()
        self._points.append((time_s, centre))
        while time_s - self._points[0][0] > WINDOW_S:
            self._points.popleft()
        return self._line() if len(self._points) >= 3 else None

    def _moved(self, time_s: float, centre: Floats) -> bool:
        last_s, last = self._points[-1]
        arcsec = float(np.linalg.norm(centre - last)) * ARCSEC
        return arcsec > SLEW_ARCSEC and arcsec * 60.0 / (time_s - last_s) > SLEW_ARCSEC_MIN

    def _line(self) -> Drift:
        times = np.array([t for t, _ in self._points])
        centres = np.array([c for _, c in self._points])
        axes = _east_north(centres[-1])
        offsets = centres @ axes.T * ARCSEC  # (N, 2) of the gnomonic plane, small angles
        minutes = (times - times.mean()) / 60.0
        spread = float(minutes @ minutes)
        slope = minutes @ (offsets - offsets.mean(axis=0)) / spread
        rest = offsets - offsets.mean(axis=0) - minutes[:, None] * slope
        sigma = np.sqrt((rest**2).sum(axis=0) / (len(times) - 2) / spread)
        return Drift(
            float(slope[0]), float(slope[1]), float(sigma[0]), float(sigma[1]),
            float(times[-1] - times[0]), len(times),
        )  # fmt: skip


def _east_north(direction: Floats) -> Floats:
    """Unit vectors (2, 3) to the east and to the north of an ICRS direction (3,)."""
    ra = np.radians(radec_deg(direction)[0])
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    return np.stack([east, np.cross(direction, east)])
