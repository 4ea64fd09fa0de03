"""What live solving reports of every frame, with its age, and the drift of the pointing."""

from collections import deque
from dataclasses import field

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, east_north
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.solver.tracker import Mode, TrackUpdate
from kochab.workflows.live.capture import Shot

WINDOW_S = 60.0
MOST = 300
SLEW_ARCSEC_MIN = 3000.0  # faster than this between two frames the mount was moved: an untracked sky makes 902 at most
SLEW_ARCSEC = 60.0


TONIGHT_S = 12 * 3600.0
"""What was taken longer ago is not of this night."""


@frozen
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
    """The drift of pointings over the last :data:`WINDOW_S`: a straight line through them."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, Floats]] = deque(maxlen=MOST)

    def forget(self) -> None:
        """Begin anew, as after a slew."""
        self._points.clear()

    def add(self, time_s: float, centre: Floats) -> Drift | None:
        """Take the ICRS unit vector (3,) of a frame's centre at ``time_s``, any steady seconds.

        None until three frames in a row were solved without a slew between them; of equal times the first counts.
        """
        if self._points and (time_s < self._points[-1][0] or self._moved(time_s, centre)):
            self.forget()
        if not self._points or time_s > self._points[-1][0]:  # headers in whole seconds, and more than a frame in each
            self._points.append((time_s, centre))
        while time_s - self._points[0][0] > WINDOW_S:  # never empties: the newest is 0 s old
            self._points.popleft()
        return self._line() if len(self._points) >= 3 else None

    def _moved(self, time_s: float, centre: Floats) -> bool:
        last_s, last = self._points[-1]
        arcsec = float(np.linalg.norm(centre - last)) / ARCSEC
        return arcsec > SLEW_ARCSEC and arcsec * 60.0 > SLEW_ARCSEC_MIN * (time_s - last_s)

    def _line(self) -> Drift:
        times = np.array([t for t, _ in self._points])
        centres = np.array([c for _, c in self._points])
        axes = east_north(centres[-1])
        offsets = centres @ axes.T / ARCSEC  # (N, 2) of the gnomonic plane, small angles
        # Minutes about their mean: slope and level are then independent. cov=True scales by the scatter, N - 2 degrees.
        line, covariance = np.polyfit((times - times.mean()) / 60.0, offsets, 1, cov=True)
        (ra, dec), (ra_sigma, dec_sigma) = line[0].tolist(), np.sqrt(covariance[0, 0]).tolist()
        return Drift(ra, dec, ra_sigma, dec_sigma, float(times[-1] - times[0]), len(times))


@frozen(eq=False)
class GoodPointing:
    """The last pointing. It is old as soon as a later frame has none."""

    solution: Solution
    number: int
    shutter_s: float

    def age_s(self, now_s: float) -> float:
        """Seconds since its mid-exposure, at ``now_s`` of :func:`time.monotonic`."""
        return now_s - self.shutter_s


@frozen(eq=False)
class LiveUpdate:
    """One frame, its result, and how the stream is doing.

    ``last_good`` is this frame's own solution, else the last one before, which is then old:
    :attr:`is_old`. ``solved_hz`` is over the last frames solved, ``frames_hz`` over those that
    came; ``dropped`` counts frames that a newer one replaced before they were looked at.
    """

    shot: Shot
    track: TrackUpdate
    done_s: float
    last_good: GoodPointing | None = None
    drift: Drift | None = None
    solved_hz: float | None = None
    frames_hz: float | None = None
    dropped: int = 0
    warnings: tuple[str, ...] = field(default=())

    @property
    def result(self) -> Solution | NoSolution:
        """The result of this very frame."""
        result = self.track.solution or self.track.reason
        assert result is not None
        return result

    @property
    def mode(self) -> Mode:
        """Whether it was solved blind or where it was expected."""
        return self.track.mode

    @property
    def is_old(self) -> bool:
        """Whether ``last_good`` belongs to an earlier frame."""
        return self.last_good is not None and self.last_good.number != self.shot.number

    @property
    def latency_ms(self) -> float:
        """From the frame's arrival to its result."""
        return (self.done_s - self.shot.received_s) * 1e3

    def age_s(self, now_s: float) -> float:
        """Seconds since mid-exposure, at ``now_s`` of :func:`time.monotonic`."""
        return now_s - self.shot.shutter_s

    @property
    def recorded(self) -> bool:
        """Whether the frame is of another night, and only came now."""
        return self.shot.received_s - self.shot.shutter_s > TONIGHT_S

    def shown_age_s(self, now_s: float) -> float:
        """Seconds since mid-exposure, of a recording since it came: whether frames still come is asked of both."""
        return now_s - self.shot.received_s if self.recorded else self.age_s(now_s)
