"""An equatorial mount: what its computer believes, and where it really points."""

import math
import threading
from collections.abc import Iterable

import erfa
import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import wrapped
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide
from kochab.simulate.mechanics.axis import MotorAxis
from kochab.simulate.mechanics.geometry import MountConfig, Wedge, camera_to_enu
from kochab.simulate.night_sky import LocalSky, SimulatedClock, altitude_deg


def fold(hour_deg: float, dec_deg: float, flipped: bool, north: bool) -> tuple[float, float]:
    """Axis angles, degrees, for a place.

    Parameters
    ----------
    hour_deg, dec_deg : float
        Hour angle and declination, degrees.
    flipped : bool
        Whether it goes through the pole.
    north : bool
        Whether the mount stands north of the equator.
    """
    if not flipped:
        return wrapped(hour_deg), dec_deg
    return wrapped(hour_deg + 180.0), (180.0 if north else -180.0) - dec_deg


def unfold(hour_deg: float, dec_deg: float) -> tuple[float, float]:
    """Hour angle in [-180, 180) and declination of axis angles, through the pole or not."""
    d = math.radians(dec_deg)
    beyond = math.cos(d) < 0.0
    return wrapped(hour_deg + 180.0 if beyond else hour_deg), math.degrees(math.asin(math.sin(d)))


NEAR_DEG = 10.0  # a goto this short does not change sides
SIGNS = {Direction.NORTH: (1, 1), Direction.SOUTH: (1, -1), Direction.EAST: (0, -1), Direction.WEST: (0, 1)}


class EquatorialMount:
    """An equatorial mount and its computer, as its hand controller sees it. Safe from any thread.

    The first encoder reads the hour angle and the second the declination of a perfect mount whose tube is east of the
    pier and looks west. On the other side the second has gone through the pole: beyond 90 deg in the north, below -90
    in the south. Parked or at home, the weights hang down and the tube looks at the pole: (90, 90), or (90, -90).
    """

    def __init__(self, config: MountConfig, site: Site, clock: SimulatedClock) -> None:
        self.config = config
        self.site = site
        self.clock = clock
        self._north = site.latitude_deg >= 0.0
        self._lock = threading.RLock()
        t = clock.now_unix()
        # the refracted pole, so that without misalignment the axis points where a polar scope would show it
        pole = LocalSky(site, t).pole_enu()
        self.wedge = Wedge(float(altitude_deg(pole)), self._north, config.misalignment_arcmin, config.bolts)
        self._home_deg = (90.0, 90.0 if self._north else -90.0)
        gears = config.hour_gear, config.dec_gear
        self._axes = [MotorAxis(angle, t, gear) for angle, gear in zip(self._home_deg, gears, strict=True)]
        for axis in self._axes:
            axis.top_deg_s, axis.acceleration = config.slew_deg_s, config.acceleration_deg_s2
        self._offset_deg = (0.0, 0.0)  # believed axis angles minus encoders, as syncs set it
        self._asked_deg = (0.0, 0.0)  # turned by hand since the last sync, because somebody was asked to
        self._synced_enu = self.wedge.to_enu()  # the wedge at the last sync, but for what moved it since unasked
        self._carrier_deg_s = 0.0
        self._parked = False
        self._parks_at: float | None = None
        self.aligned = config.aligned
        believed = config.computer_site or site
        self.latitude_deg, self.longitude_deg = believed.latitude_deg, believed.longitude_deg

    # What it really does.

    def axes_deg(self) -> tuple[float, float]:
        """The two encoders."""
        with self._lock:
            return self._motors(self.clock.now_unix())

    def true_axes_deg(self, t: float) -> tuple[float, float]:
        """The axes at ``t`` (unix s) behind gears and clutches."""
        with self._lock:
            return self._axes[0].true_deg(t), self._axes[1].true_deg(t)

    def attitude_enu_to_camera(self, t: float) -> Floats:
        """Rotation (3, 3) from observed directions (E, N, U) to camera axes at ``t``, unix seconds."""
        with self._lock:
            hour, dec = self.true_axes_deg(t)
            return np.asarray(camera_to_enu(hour, dec, self.wedge.to_enu(), self.config.build).T)

    def busy_until(self) -> float:
        """When the motion planned so far is over, unix s of the true clock."""
        with self._lock:
            return max(axis.busy_until() for axis in self._axes)

    def turn_bolts(self, altitude_arcmin: float, azimuth_arcmin: float, asked: bool = False) -> None:
        """Turn the two bolts by what they would move without backlash or coupling; ``asked`` as in turns by hand."""
        with self._lock:
            before = self.wedge.to_enu()
            self.wedge.turn(altitude_arcmin, azimuth_arcmin)
            if not asked:
                self._synced_enu = self.wedge.to_enu() @ before.T @ self._synced_enu

    def before_bolts(self, direction_enu: Floats) -> Floats:
        """Where the tube would look, (3,) east, north, up, had nobody turned the bolts as asked since the last sync."""
        with self._lock:
            return np.asarray(self._synced_enu @ self.wedge.to_enu().T @ direction_enu)

    def turn_by_hand(self, hour_deg: float, dec_deg: float = 0.0, asked: bool = False) -> None:
        """Open the clutches and turn the axes; the encoders do not see it. ``asked`` is remembered until a sync."""
        with self._lock:
            t = self.clock.now_unix()
            if asked:
                self._asked_deg = self._asked_deg[0] + hour_deg, self._asked_deg[1] + dec_deg
            self._axes[0].displace(t, hour_deg)
            self._axes[1].displace(t, dec_deg)

    def place(self, hour_deg: float, dec_deg: float, flipped: bool = False) -> None:
        """Stand at once at these true hour angle and declination of the mount's own axis.

        Its computer then believes just that; the tube's own errors come on top.
        """
        with self._lock:
            t = self.clock.now_unix()
            for axis, angle in zip(self._axes, fold(hour_deg, dec_deg, flipped, self._north), strict=True):
                axis.place(t, angle)
            self._offset_deg = (0.0, 0.0)  # believed axis angles minus encoders, as syncs set it
            self._axes[0].run(t, self._carrier(0), gently=False)

    def _carrier(self, axis: int) -> float:
        """The rate below all other motion."""
        return self._carrier_deg_s if axis == 0 else 0.0

    def _motors(self, t: float) -> tuple[float, float]:
        return self._axes[0].motor_deg(t), self._axes[1].motor_deg(t)

    def _believed(self, t: float) -> tuple[float, float]:
        hour, dec = self._motors(t)
        return hour + self._offset_deg[0], dec + self._offset_deg[1]

    # What its computer knows and believes, from encoders, clock and site.

    def now_unix(self) -> float:
        """Seconds since 1970 UTC by the simulated clock, with the computer's own error."""
        return self.clock.now_unix() + self.config.computer_clock_s

    def sidereal_deg(self, t: float | None = None) -> float:
        """The computer's local sidereal time at ``t`` (unix s), now at None; by its own clock and longitude."""
        believed = Site(self.latitude_deg, self.longitude_deg)
        true = self.clock.now_unix() if t is None else t
        return math.degrees(LocalSky(believed, true + self.config.computer_clock_s).sidereal_rad)

    def believed_deg(self, asked: bool = False) -> tuple[float, float]:
        """RA in [0, 360) and Dec of date where it believes to point, had it seen turns by hand that were ``asked``."""
        with self._lock:
            t = self.clock.now_unix()
            hour, dec = unfold(*np.add(self._believed(t), self._asked_deg if asked else 0.0).tolist())
            return (self.sidereal_deg(t) - hour) % 360.0, dec

    def from_home_deg(self) -> tuple[float, float]:
        """How far from home its computer believes the axes to be."""
        with self._lock:
            hour, dec = self._believed(self.clock.now_unix())
            return hour - self._home_deg[0], dec - self._home_deg[1]

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

    def _reachable(self, hour_deg: float, dec_deg: float, t: float) -> tuple[float, float] | None:
        """Encoder angles for a target: a short way on this side of the pier, else the side for it.

        A tube that looks east belongs west of the pier, but near the meridian it need not go round for a correction.
        """
        motors = self._motors(t)
        east = wrapped(hour_deg) < 0.0
        sides = [east, not east] if self.config.german else [False]
        ways = [self._on_side(hour_deg, dec_deg, flipped, motors) for flipped in sides]
        ends = [end for end in ways if end is not None]
        near = [end for end in ends if max(abs(end[k] - motors[k]) for k in (0, 1)) < NEAR_DEG]
        return next(iter(near or ends), None)

    def _on_side(
        self, hour_deg: float, dec_deg: float, flipped: bool, motors: tuple[float, float]
    ) -> tuple[float, float] | None:
        hour, dec = np.subtract(fold(hour_deg, dec_deg, flipped, self._north), self._offset_deg).tolist()
        low, high = -180.0, 180.0  # a fork's whole turn
        if self.config.german:  # weights down by half a turn
            low, high = -self.config.past_meridian_deg, 180.0 + self.config.past_meridian_deg
        # an offset may carry the angle past a turn: take the turn that is within the stops
        allowed = [h for k in (-2, -1, 0, 1, 2) if low <= (h := hour + 360.0 * k) <= high]
        return (min(allowed, key=lambda h: abs(h - motors[0])), dec) if allowed else None

    # Commands.

    def goto(self, ra_deg: float, dec_deg: float) -> str | None:
        """Begin a slew, or say why not: "parked", "below horizon", "limits"."""
        with self._lock:
            if self.parked:
                return "parked"
            t = self.clock.now_unix()
            hour = self.sidereal_deg(t) - ra_deg
            if erfa.hd2ae(*np.radians([hour, dec_deg, self.latitude_deg]))[1] < 0.0:
                return "below horizon"
            target = self._reachable(hour, dec_deg, t)
            if target is None:
                return "limits"
            self._parks_at = None
            self._carrier_deg_s = self._carrier_deg_s or SIDEREAL_DEG_S
            self._axes[0].slew(t, target[0], self._carrier_deg_s, self.config.approach_deg)
            self._axes[1].slew(t, target[1], 0.0, self.config.approach_deg)
            return None

    def sync(self, ra_deg: float, dec_deg: float) -> str | None:
        """Believe to point here; refused when parked or slewing."""
        with self._lock:
            if self.parked:
                return "parked"
            if self.slewing:
                return "moving"
            t = self.clock.now_unix()
            motors = self._motors(t)
            flipped = self.pier_side is PierSide.WEST
            there = fold(self.sidereal_deg(t) - ra_deg, dec_deg, flipped, self._north)
            self._offset_deg = wrapped(there[0] - motors[0]), wrapped(there[1] - motors[1])
            self._asked_deg, self._synced_enu = (0.0, 0.0), self.wedge.to_enu()
            return None

    def stop(self, moves: bool = True) -> None:
        """Stop every motion but tracking; without ``moves`` those go on that :meth:`move` began."""
        # A slew ends at the rate of tracking, a move does not.
        self._end(n for n in (0, 1) if moves or abs(self._axes[n].last_rate_deg_s - self._carrier(n)) < 1e-9)

    def pulse(self, direction: Direction, milliseconds: float) -> None:
        """Move at the guide rate for so long."""
        with self._lock:
            if self.parked or self.slewing:
                return
            axis, sign = self._sign(direction)
            rate = sign * self.config.guide_rate * SIDEREAL_DEG_S
            self._axes[axis].nudge(self.clock.now_unix(), rate, milliseconds / 1e3, self._carrier(axis))

    def move(self, direction: Direction, rate_deg_s: float) -> None:
        """Move until :meth:`halt`, relative to tracking."""
        with self._lock:
            if self.parked:
                return
            axis, sign = self._sign(direction)
            rate = sign * min(abs(rate_deg_s), self.config.slew_deg_s)
            self._axes[axis].run(self.clock.now_unix(), self._carrier(axis) + rate)

    def halt(self, direction: Direction | None = None) -> None:
        """End a move in one direction, or in all."""
        self._end((0, 1) if direction is None else (SIGNS[direction][0],))

    def _end(self, axes: Iterable[int]) -> None:
        """Let these axes do nothing but track."""
        with self._lock:
            t = self.clock.now_unix()
            self._parks_at = None
            for axis in axes:
                self._axes[axis].run(t, self._carrier(axis))

    def turn_axis(self, axis: int, rate_deg_s: float) -> None:
        """A bare motor: axis 0 or 1 at this rate against the pier, tracking not added."""
        with self._lock:
            if axis == 0:
                self._carrier_deg_s = 0.0
            self._axes[axis].run(self.clock.now_unix(), rate_deg_s)

    def turn_axis_to(self, axis: int, angle_deg: float) -> None:
        """A bare motor: axis 0 or 1 to this encoder angle at the slew rate, then at rest."""
        with self._lock:
            if axis == 0:
                self._carrier_deg_s = 0.0
            self._axes[axis].slew(self.clock.now_unix(), angle_deg)

    def park(self) -> None:
        """Go home, weights down and the tube on the pole, and stay there."""
        with self._lock:
            self._parks_at = self.go_home()

    def go_home(self) -> float:
        """Go where it was switched on; when it will be there, unix s."""
        with self._lock:
            t = self.clock.now_unix()
            self._carrier_deg_s, self._parks_at = 0.0, None
            return max(axis.slew(t, angle) for axis, angle in zip(self._axes, self._home_deg, strict=True))

    @property
    def parked(self) -> bool:
        """Whether it has been parked and has arrived; set, it parks or is ready again, tracking off."""
        with self._lock:
            if self._parks_at is not None and self.clock.now_unix() >= self._parks_at:
                self._parked, self._parks_at = True, None
            return self._parked

    @parked.setter
    def parked(self, on: bool) -> None:
        if on:
            self.park()
            return
        with self._lock:
            self._parked, self._parks_at = False, None

    @property
    def tracking(self) -> bool:
        """Whether the hour axis follows the sky."""
        return self._carrier_deg_s != 0.0

    @tracking.setter
    def tracking(self, on: bool) -> None:
        if on != self.tracking:
            self.tracking_deg_s = SIDEREAL_DEG_S if on else 0.0

    @property
    def tracking_deg_s(self) -> float:
        """The rate at which it follows, 0 when it does not."""
        return self._carrier_deg_s

    @tracking_deg_s.setter
    def tracking_deg_s(self, rate: float) -> None:
        with self._lock:
            if rate and self.parked:
                return
            self._axes[0].carry(self.clock.now_unix(), rate - self._carrier_deg_s)
            self._carrier_deg_s = rate

    def _sign(self, direction: Direction) -> tuple[int, float]:
        """The axis and the way its angle goes; through the pole, north is backwards."""
        axis, sign = SIGNS[direction]
        return axis, -sign if axis == 1 and self.pier_side is PierSide.WEST else sign
