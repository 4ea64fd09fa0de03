"""A telescope for trying a responder alone: no errors, straight slews, a clock of its own."""

import math
import threading
import time
from collections.abc import Callable

from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide

AXIS_OF = {Direction.NORTH: (1, 1.0), Direction.SOUTH: (1, -1.0), Direction.EAST: (0, -1.0), Direction.WEST: (0, 1.0)}
GUIDE_DEG_S = 0.5 * SIDEREAL_DEG_S


class BenchTelescope:
    """Keeps two axes, hour angle and declination, and moves them at ``slew_deg_s`` (0: at once).

    It begins at home, where the first reads 90 and the second the pole.

    ``log`` holds every order that came, in order. ``now`` is the clock, seconds since 1970.
    """

    def __init__(
        self,
        latitude_deg: float = 50.0,
        longitude_deg: float = 8.0,
        slew_deg_s: float = 0.0,
        now: Callable[[], float] = time.time,
    ) -> None:
        self.latitude_deg, self.longitude_deg = latitude_deg, longitude_deg
        self.now_unix = now
        self._parked, self.aligned = False, True
        self.pier_side = PierSide.WEST
        self.lowest_deg = 0.0
        self.log: list[tuple[object, ...]] = []
        self._slew_deg_s = slew_deg_s
        self._lock = threading.RLock()
        self._axes = [90.0, 90.0 if latitude_deg >= 0 else -90.0]  # home, weights down
        self._offset = [0.0, 0.0]  # believed minus encoder
        self._rates = [0.0, 0.0]  # beside tracking
        self._targets: list[float | None] = [None, None]
        self._goto: tuple[float, float] | None = None
        self._tracking_deg_s = SIDEREAL_DEG_S
        self._last = now()

    @property
    def slewing(self) -> bool:
        """A goto is under way."""
        with self._lock:
            self._advance()
            return self._goto is not None or any(t is not None for t in self._targets)

    @property
    def tracking(self) -> bool:
        """The first axis follows the sky."""
        return self._tracking_deg_s != 0.0

    @tracking.setter
    def tracking(self, on: bool) -> None:
        if on != self.tracking:
            self.tracking_deg_s = SIDEREAL_DEG_S if on else 0.0

    @property
    def tracking_deg_s(self) -> float:
        """How fast."""
        return self._tracking_deg_s

    @tracking_deg_s.setter
    def tracking_deg_s(self, rate: float) -> None:
        with self._lock:
            self._advance()
            self._tracking_deg_s = rate

    def go_home(self) -> None:
        """Where it believes to have been switched on."""
        self.log.append(("home",))
        with self._lock:
            self._advance()
            self.tracking_deg_s, self._goto = 0.0, None
            self._targets = [90.0 - self._offset[0], math.copysign(90.0, self.latitude_deg) - self._offset[1]]
            self._advance()

    @property
    def parked(self) -> bool:
        """Has been parked, and is there."""
        return self._parked and not self.slewing

    @parked.setter
    def parked(self, on: bool) -> None:
        self._parked = on
        if on:
            self.go_home()

    def sidereal_deg(self) -> float:
        """Local sidereal time by a linear formula, good to a second this century."""
        days = self.now_unix() / 86400.0 + 2440587.5 - 2451545.0
        return (280.46061837 + 360.98564736629 * days + self.longitude_deg) % 360.0

    def axes_deg(self) -> tuple[float, float]:
        """Hour angle and declination by the encoders."""
        with self._lock:
            self._advance()
            return self._axes[0], self._axes[1]

    def from_home_deg(self) -> tuple[float, float]:
        """How far it believes to have turned since home, where it was switched on."""
        hour, dec = (a + b for a, b in zip(self.axes_deg(), self._offset, strict=True))
        return hour - 90.0, dec - math.copysign(90.0, self.latitude_deg)

    def believed_deg(self) -> tuple[float, float]:
        """RA and Dec of date."""
        hour_angle, dec = (a + b for a, b in zip(self.axes_deg(), self._offset, strict=True))
        if abs(dec) > 90.0:  # through the pole
            hour_angle, dec = hour_angle + 180.0, math.copysign(180.0, dec) - dec
        return (self.sidereal_deg() - hour_angle) % 360.0, dec

    def altitude_deg(self, ra_deg: float, dec_deg: float) -> float:
        """Height over the horizon without air."""
        h, d, p = (math.radians(a) for a in (self.sidereal_deg() - ra_deg, dec_deg, self.latitude_deg))
        sine = math.sin(p) * math.sin(d) + math.cos(p) * math.cos(d) * math.cos(h)
        return math.degrees(math.asin(max(-1.0, min(1.0, sine))))

    def goto(self, ra_deg: float, dec_deg: float) -> str | None:
        """Begin a slew, or say why not."""
        self.log.append(("goto", ra_deg, dec_deg))
        if self.parked:
            return "parked"
        if self.altitude_deg(ra_deg, dec_deg) < self.lowest_deg:
            return "below horizon"
        with self._lock:
            self._goto = (ra_deg, dec_deg)
            self._advance()
        return None

    def sync(self, ra_deg: float, dec_deg: float) -> str | None:
        """Believe to point here."""
        self.log.append(("sync", ra_deg, dec_deg))
        with self._lock:
            hour_angle, dec = self.axes_deg()
            wanted = _turn(self.sidereal_deg() - ra_deg)
            self._offset = [_turn(wanted - hour_angle), dec_deg - dec]
        return None

    def stop(self, moves: bool = True) -> None:
        """Stop everything but tracking; without ``moves``, slews alone."""
        self.log.append(("stop",))
        with self._lock:
            self._advance()
            self._parked = self.parked
            self._goto, self._targets = None, [None, None]
            self._rates = [0.0, 0.0] if moves else self._rates

    def pulse(self, direction: Direction, milliseconds: float) -> None:
        """Moved by at once."""
        self.log.append(("pulse", direction, milliseconds))
        axis, sign = AXIS_OF[direction]
        with self._lock:
            self._axes[axis] += sign * GUIDE_DEG_S * milliseconds / 1000.0

    def move(self, direction: Direction, rate_deg_s: float) -> None:
        """Move until halted."""
        self.log.append(("move", direction, rate_deg_s))
        axis, sign = AXIS_OF[direction]
        with self._lock:
            self._advance()
            self._rates[axis] = sign * rate_deg_s

    def halt(self, direction: Direction | None = None) -> None:
        """End moves."""
        self.log.append(("halt", direction))
        with self._lock:
            self._advance()
            for axis in (0, 1) if direction is None else (AXIS_OF[direction][0],):
                self._rates[axis] = 0.0

    def turn_axis(self, axis: int, rate_deg_s: float) -> None:
        """A bare motor's rate against the pier; tracking is then not added."""
        self.log.append(("turn", axis, rate_deg_s))
        with self._lock:
            self._advance()
            self._targets[axis] = None
            self._rates[axis] = rate_deg_s
            if axis == 0:
                self._tracking_deg_s = 0.0

    def turn_axis_to(self, axis: int, angle_deg: float) -> None:
        """A bare motor's slew."""
        self.log.append(("turn to", axis, angle_deg))
        with self._lock:
            self._advance()
            self._rates[axis] = 0.0
            self._targets[axis] = angle_deg
            if axis == 0:
                self._tracking_deg_s = 0.0
            self._advance()

    def _advance(self) -> None:
        """Move both axes on to now."""
        now = self.now_unix()
        elapsed, self._last = now - self._last, now
        sky = self._tracking_deg_s
        self._axes[0] += (self._rates[0] + sky) * elapsed
        self._axes[1] += self._rates[1] * elapsed
        targets = list(self._targets)
        if self._goto is not None:
            ra, dec = self._goto
            targets = [_turn(self.sidereal_deg() - ra) - self._offset[0], dec - self._offset[1]]
        for axis, target in enumerate(targets):
            if target is not None and self._step(axis, target, elapsed):
                targets[axis] = self._targets[axis] = None
        if self._goto is not None and targets == [None, None]:
            self._goto = None

    def _step(self, axis: int, target: float, elapsed: float) -> bool:
        """Towards ``target``; True once there."""
        way, reach = target - self._axes[axis], self._slew_deg_s * elapsed
        if self._slew_deg_s <= 0 or abs(way) <= reach:
            self._axes[axis] = target
            return True
        self._axes[axis] += math.copysign(reach, way)
        return False


def _turn(angle_deg: float) -> float:
    """Into [-180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0
