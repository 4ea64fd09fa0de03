"""A German mount's axes, which take time to start and stop, and the tube on them, whose direction is the truth.

Axis 1 turns with the sky, axis 2 in declination. With axis 2 below 90 deg the tube looks at hour angle ``axis 1`` and
declination ``axis 2``; beyond the pole, on the other side of the pier, at ``axis 1 - 180`` and ``180 - axis 2``. The
counterweight hangs down with axis 1 at 90 deg. Northern sites only.
"""

from dataclasses import dataclass
from math import copysign, sqrt

from .sky import LATITUDE_DEG, LONGITUDE_DEG, altaz_deg, apart_deg, half_turn, sidereal_deg, sun_deg

HOME_DEG = (90.0, 90.0)  # counterweight down, tube at the pole
STEP_S = 0.01
SAMPLE_S = 0.1
LONGEST_CATCH_UP_S = 120.0  # of a thread that was not let run


class Axis:
    """An axis that accelerates; it follows the sky, a rate by hand, or runs to a target that moves with the sky."""

    def __init__(self, at_deg, top_deg_s, acceleration_deg_s2):
        self.at_deg = at_deg
        self.top_deg_s = top_deg_s
        self.acceleration_deg_s2 = acceleration_deg_s2
        self.rate_deg_s = 0.0
        self.follows_deg_s = 0.0
        self.by_hand_deg_s = 0.0
        self.target_deg = None

    @property
    def runs(self):
        """Whether it does anything but follow."""
        return self.target_deg is not None or abs(self.rate_deg_s - self.follows_deg_s) > 1e-3

    def stop(self):
        """Begin to slow down."""
        self.target_deg, self.by_hand_deg_s = None, 0.0

    def lose_power(self):
        """The gears hold it at once."""
        self.stop()
        self.rate_deg_s = self.follows_deg_s = 0.0

    def step(self, dt):
        """One short step in time."""
        most = self.acceleration_deg_s2 * dt
        wanted = self.follows_deg_s + self.by_hand_deg_s
        if self.target_deg is not None:
            self.target_deg += self.follows_deg_s * dt
            left = self.target_deg - self.at_deg
            relative = self.rate_deg_s - self.follows_deg_s
            if abs(left) < 3.0 * most * dt and abs(relative) < 4.0 * most:
                self.at_deg, self.rate_deg_s, self.target_deg = self.target_deg, self.follows_deg_s, None
                return
            # The speed from which it can still stop at the target, a step from now.
            wanted += copysign(min(self.top_deg_s, sqrt(1.8 * self.acceleration_deg_s2 * abs(left))), left)
        before = self.rate_deg_s
        self.rate_deg_s += max(-most, min(most, wanted - before))
        self.at_deg += 0.5 * (before + self.rate_deg_s) * dt


@dataclass(frozen=True)
class Sample:
    """The tube at a moment: unix time, true RA and Dec of date, altitude, azimuth, and how far from the Sun."""

    unix: float
    ra_deg: float
    dec_deg: float
    altitude_deg: float
    azimuth_deg: float
    sun_deg: float
    sun_altitude_deg: float


class Tube:
    """The axes, where the tube on them truly points, and the path it took."""

    def __init__(self, clock, top_deg_s, acceleration_deg_s2, latitude_deg=LATITUDE_DEG, longitude_deg=LONGITUDE_DEG):
        self.clock = clock
        self.latitude_deg, self.longitude_deg = latitude_deg, longitude_deg
        self.axes = [Axis(at, top_deg_s, acceleration_deg_s2) for at in HOME_DEG]
        self.path = []
        self.driven_deg = 0.0  # by the motors, besides following the sky
        self.now = clock.unix()
        self._sampled = 0.0

    def advance(self):
        """Up to now."""
        until = self.clock.unix()
        self.now = max(self.now, until - LONGEST_CATCH_UP_S)
        while self.now < until:
            dt = min(STEP_S, until - self.now)
            for axis in self.axes:
                axis.step(dt)
            self.now += dt
            if self.runs:
                self.driven_deg += dt * max(abs(axis.rate_deg_s - axis.follows_deg_s) for axis in self.axes)
                if self.now - self._sampled >= SAMPLE_S:
                    self.sample()

    def sample(self):
        """Write down where the tube is."""
        self._sampled = self.now
        sun, lst = sun_deg(self.now), sidereal_deg(self.now, self.longitude_deg)
        self.path.append(
            Sample(
                self.now,
                *self.radec_deg(),
                *self.altaz_deg(),
                apart_deg(self.radec_deg(), sun),
                altaz_deg(lst - sun[0], sun[1], self.latitude_deg)[0],
            )
        )

    @property
    def runs(self):
        """Whether an axis does anything but follow the sky."""
        return any(axis.runs for axis in self.axes)

    def hour_angle_dec_deg(self):
        """Truth, hour angle in [-180, 180)."""
        return looks_at_deg(*(axis.at_deg for axis in self.axes))

    def radec_deg(self):
        """Truth of date."""
        hour_angle, dec = self.hour_angle_dec_deg()
        return (sidereal_deg(self.now, self.longitude_deg) - hour_angle) % 360.0, dec

    def altaz_deg(self):
        """Truth, without refraction."""
        return altaz_deg(*self.hour_angle_dec_deg(), self.latitude_deg)


def looks_at_deg(axis_1_deg, axis_2_deg):
    """Hour angle and declination of the tube with the axes at these angles."""
    turned = (axis_2_deg + 90.0) % 360.0 - 90.0
    if turned <= 90.0:
        return half_turn(axis_1_deg), turned
    return half_turn(axis_1_deg - 180.0), 180.0 - turned


def axes_deg(hour_angle_deg, dec_deg, beyond):
    """The axes that look there, ``beyond`` the pole or not; axis 1 nearest to the counterweight hanging down."""
    hour_angle = half_turn(hour_angle_deg)
    if beyond:
        return 90.0 + half_turn(hour_angle + 90.0), 180.0 - dec_deg
    return 90.0 + half_turn(hour_angle - 90.0), dec_deg
