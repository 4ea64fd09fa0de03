"""What a mount's own computer knows and believes, from its encoders, its clock and its site."""

import math

from app.core.hint import Site
from app.core.mount import PierSide
from app.simulate.clock import SimulatedClock
from app.simulate.local_sky import Air, LocalSky
from app.simulate.mechanics.belief import fold, halves, unfold, wrapped
from app.simulate.mechanics.body import MountBody
from app.simulate.mechanics.config import MountConfig

Degrees = tuple[float, float]
NEAR_DEG = 10.0  # a goto this short does not change sides


class MountComputer(MountBody):
    """Beliefs, and which axis angles it would choose for a target."""

    def __init__(
        self, config: MountConfig, site: Site, clock: SimulatedClock, air: Air | None = None
    ) -> None:
        super().__init__(config, site, clock, air)
        self.aligned = config.aligned
        believed = config.computer_site or site
        self.latitude_deg = believed.latitude_deg
        self.longitude_deg = believed.longitude_deg
        self._parked = False
        self._parks_at: float | None = None

    def now_unix(self) -> float:
        """Seconds since 1970 UTC by the simulated clock, with the computer's own error."""
        return self.clock.now_unix() + self.config.computer_clock_s

    def sidereal_deg(self) -> float:
        """The computer's local sidereal time, from its own clock and longitude."""
        return self._sidereal_deg(self.clock.now_unix())

    def believed_deg(self) -> tuple[float, float]:
        """RA in [0, 360) and Dec of date where it believes to point."""
        with self._lock:
            t = self.clock.now_unix()
            hour, dec = unfold(*self._belief.of(*self._motors(t)))
            return (self._sidereal_deg(t) - hour) % 360.0, dec

    def from_home_deg(self) -> tuple[float, float]:
        """How far from home its computer believes the axes to be."""
        with self._lock:
            hour, dec = self._belief.of(*self._motors(self.clock.now_unix()))
            return hour - 90.0, dec - (90.0 if self._north else -90.0)

    @property
    def slewing(self) -> bool:
        """Whether an axis moves, or is about to move, faster than guiding does."""
        with self._lock:
            t = self.clock.now_unix()
            return any(axis.planned_fast(t) for axis in self._axes)

    @property
    def pier_side(self) -> PierSide:
        """The tube's side of the pier by the second encoder; west when it looks east."""
        _, dec = self.axes_deg()
        return PierSide.WEST if abs(dec) > 90.0 else PierSide.EAST

    @property
    def _flipped(self) -> bool:
        return self.pier_side is PierSide.WEST

    def _sidereal_deg(self, t: float) -> float:
        believed = Site(self.latitude_deg, self.longitude_deg)
        sky = LocalSky(believed, t + self.config.computer_clock_s, self.air)
        return math.degrees(sky.sidereal_rad)

    def _altitude_deg(self, hour_deg: float, dec_deg: float) -> float:
        h, d, p = (math.radians(x) for x in (hour_deg, dec_deg, self.latitude_deg))
        sine = math.sin(p) * math.sin(d) + math.cos(p) * math.cos(d) * math.cos(h)
        return math.degrees(math.asin(max(-1.0, min(1.0, sine))))

    def _reachable(self, hour_deg: float, dec_deg: float, t: float) -> tuple[float, float] | None:
        """Encoder angles for a target: a short way on this side of the pier, else the side for it.

        A tube that looks east belongs west of the pier, but near the meridian it need not go
        round for a correction.
        """
        motors = self._motors(t)
        east = wrapped(hour_deg) < 0.0
        sides = [east, not east] if self.config.german else [False]
        ways = [self._on_side(hour_deg, dec_deg, flipped, motors) for flipped in sides]
        ends = [end for end in ways if end is not None]
        near = [end for end in ends if _apart_deg(end, motors) < NEAR_DEG]
        return next(iter(near or ends), None)

    def _on_side(
        self, hour_deg: float, dec_deg: float, flipped: bool, motors: tuple[float, float]
    ) -> tuple[float, float] | None:
        hour, dec = self._belief.motors_for(*fold(hour_deg, dec_deg, flipped, self._north))
        low, high = halves(self.config.german, self.config.past_meridian_deg)
        allowed = [h for k in (-2, -1, 0, 1, 2) if low <= (h := hour + 360.0 * k) <= high]
        return (min(allowed, key=lambda h: abs(h - motors[0])), dec) if allowed else None


def _apart_deg(a: tuple[float, float], b: tuple[float, float]) -> float:
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]))
