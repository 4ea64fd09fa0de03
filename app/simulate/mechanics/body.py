"""The body of an equatorial mount: two axes on a wedge, where they really point, and hands."""

import threading

import numpy as np
from numpy.typing import NDArray

from app.core.earth import SIDEREAL_DEG_S
from app.core.hint import Site
from app.simulate.clock import SimulatedClock
from app.simulate.local_sky import Air, LocalSky, altitude_deg
from app.simulate.mechanics.axis import Axis
from app.simulate.mechanics.belief import Belief, fold
from app.simulate.mechanics.bolts import Wedge
from app.simulate.mechanics.config import MountConfig
from app.simulate.mechanics.geometry import camera_to_enu
from app.simulate.mechanics.wear import AxisFailure

Floats = NDArray[np.float64]


class MountBody:
    """Axes and wedge through time.

    The first encoder reads the hour angle and the second the declination of a perfect mount
    whose tube is east of the pier and looks west. On the other side the second has gone through
    the pole: beyond 90 deg in the north, below -90 in the south. Parked or at home, the weights
    hang down and the tube looks at the pole: (90, 90), or (90, -90).
    """

    def __init__(
        self, config: MountConfig, site: Site, clock: SimulatedClock, air: Air | None = None
    ) -> None:
        self.config = config
        self.site = site
        self.clock = clock
        self.air = air or Air()
        self._north = site.latitude_deg >= 0.0
        self._lock = threading.RLock()
        t = clock.now_unix()
        pole = LocalSky(site, t, self.air).pole_enu()
        self.wedge = Wedge(
            float(altitude_deg(pole)), self._north, config.misalignment_arcmin, config.bolts
        )
        self._axes = (
            Axis(90.0, t, config.hour_wear),
            Axis(90.0 if self._north else -90.0, t, config.dec_wear),
        )
        for axis in self._axes:
            axis.top_deg_s, axis.acceleration = config.slew_deg_s, config.acceleration_deg_s2
        self._belief = Belief()
        self._tracking = False

    def axes_deg(self) -> tuple[float, float]:
        """The two encoders."""
        with self._lock:
            return self._motors(self.clock.now_unix())

    def true_axes_deg(self, t: float) -> tuple[float, float]:
        """The axes at ``t`` (unix s) behind gears and clutches."""
        with self._lock:
            return self._axes[0].true_deg(t), self._axes[1].true_deg(t)

    def camera_to_enu(self, t: float) -> Floats:
        """Rotation (3, 3) from camera axes to east, north, up at ``t``, unix seconds."""
        with self._lock:
            hour, dec = self.true_axes_deg(t)
            return camera_to_enu(hour, dec, self.wedge.to_enu(), self.config.build)

    def attitude_enu_to_camera(self, t: float) -> Floats:
        """Rotation (3, 3) from observed directions (E, N, U) to camera axes at ``t``."""
        return np.asarray(self.camera_to_enu(t).T)

    def busy_until(self) -> float:
        """When the motion planned so far is over, unix s of the true clock."""
        with self._lock:
            return max(axis.busy_until() for axis in self._axes)

    def turn_bolts(self, altitude_arcmin: float, azimuth_arcmin: float) -> None:
        """Turn the two bolts by what they would move without play or coupling."""
        with self._lock:
            self.wedge.turn(altitude_arcmin, azimuth_arcmin)

    def turn_by_hand(self, hour_deg: float, dec_deg: float = 0.0) -> None:
        """Open the clutches and turn the axes; the encoders do not see it."""
        with self._lock:
            t = self.clock.now_unix()
            self._axes[0].displace(t, hour_deg)
            self._axes[1].displace(t, dec_deg)

    def place(self, hour_deg: float, dec_deg: float, flipped: bool = False) -> None:
        """Stand at once at these true hour angle and declination of the mount's own axis.

        Its computer then believes just that; the tube's own errors come on top.
        """
        with self._lock:
            t = self.clock.now_unix()
            for axis, angle in zip(
                self._axes, fold(hour_deg, dec_deg, flipped, self._north), strict=True
            ):
                axis.place(t, angle)
            self._belief = Belief()
            self._axes[0].run(t, self._carrier, gently=False)

    def fail(self, axis: int, failure: AxisFailure, misread_deg: float = 40.0) -> None:
        """Let axis 0 or 1 break now; ``misread_deg`` is the jump of its encoder."""
        with self._lock:
            self._axes[axis].failure = failure
            if failure is AxisFailure.JUMP:
                self._axes[axis].misread_deg += misread_deg

    @property
    def _carrier(self) -> float:
        return SIDEREAL_DEG_S if self._tracking else 0.0

    def _motors(self, t: float) -> tuple[float, float]:
        return self._axes[0].motor_deg(t), self._axes[1].motor_deg(t)
