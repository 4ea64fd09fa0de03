"""An equatorial mount: what its computer believes, and where it really points."""

from app.core.earth import SIDEREAL_DEG_S
from app.core.mount import Direction
from app.simulate.mechanics.belief import fold
from app.simulate.mechanics.computer import MountComputer
from app.simulate.mechanics.config import MountConfig

__all__ = ["EquatorialMount", "MountConfig"]

SIGNS = {Direction.NORTH: (1, 1), Direction.SOUTH: (1, -1), Direction.EAST: (0, -1)}
SIGNS[Direction.WEST] = (0, 1)


class EquatorialMount(MountComputer):
    """A :class:`~app.simulate.telescope.Telescope` with mechanics. Safe from any thread."""

    def goto(self, ra_deg: float, dec_deg: float) -> str | None:
        """Begin a slew, or say why not: "parked", "below horizon", "limits"."""
        with self._lock:
            if self.parked:
                return "parked"
            t = self.clock.now_unix()
            hour = self._sidereal_deg(t) - ra_deg
            if self._altitude_deg(hour, dec_deg) < self.config.horizon_deg:
                return "below horizon"
            target = self._reachable(hour, dec_deg, t)
            if target is None:
                return "limits"
            self._parks_at = None
            self._tracking = True
            self._axes[0].slew(t, target[0], SIDEREAL_DEG_S, self.config.approach_deg)
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
            there = fold(self._sidereal_deg(t) - ra_deg, dec_deg, self._flipped, self._north)
            self._belief.set(motors, there)
            return None

    def stop(self) -> None:
        """Stop every motion but tracking."""
        self.halt()

    def pulse(self, direction: Direction, milliseconds: float) -> None:
        """Move at the guide rate for so long."""
        with self._lock:
            if self.parked or self.slewing:
                return
            axis, sign = self._sign(direction)
            rate = sign * self.config.guide_rate * SIDEREAL_DEG_S
            carrier = self._carrier if axis == 0 else 0.0
            self._axes[axis].nudge(self.clock.now_unix(), rate, milliseconds / 1e3, carrier)

    def move(self, direction: Direction, rate_deg_s: float) -> None:
        """Move until :meth:`halt`, relative to tracking."""
        with self._lock:
            if self.parked:
                return
            axis, sign = self._sign(direction)
            rate = sign * min(abs(rate_deg_s), self.config.slew_deg_s)
            carrier = self._carrier if axis == 0 else 0.0
            self._axes[axis].run(self.clock.now_unix(), carrier + rate)

    def halt(self, direction: Direction | None = None) -> None:
        """End a move in one direction, or in all."""
        with self._lock:
            t = self.clock.now_unix()
            self._parks_at = None
            axes = (0, 1) if direction is None else (SIGNS[direction][0],)
            for axis in axes:
                self._axes[axis].run(t, self._carrier if axis == 0 else 0.0)

    def turn_axis(self, axis: int, rate_deg_s: float) -> None:
        """A bare motor: axis 0 or 1 at this rate against the pier, tracking not added."""
        with self._lock:
            if axis == 0:
                self._tracking = False
            self._axes[axis].run(self.clock.now_unix(), rate_deg_s)

    def turn_axis_to(self, axis: int, angle_deg: float) -> None:
        """A bare motor: axis 0 or 1 to this encoder angle at the slew rate, then at rest."""
        with self._lock:
            if axis == 0:
                self._tracking = False
            self._axes[axis].slew(self.clock.now_unix(), angle_deg)

    def park(self) -> None:
        """Go home, weights down and the tube on the pole, and stay there."""
        with self._lock:
            t = self.clock.now_unix()
            self._tracking = False
            home = (90.0, 90.0 if self._north else -90.0)
            self._parks_at = max(
                axis.slew(t, angle) for axis, angle in zip(self._axes, home, strict=True)
            )

    def unpark(self) -> None:
        """Be ready to move again; tracking stays off."""
        with self._lock:
            self._parked, self._parks_at = False, None

    @property
    def parked(self) -> bool:
        """Whether it has been parked and has arrived; set, it parks or is ready again."""
        with self._lock:
            if self._parks_at is not None and self.clock.now_unix() >= self._parks_at:
                self._parked, self._parks_at = True, None
            return self._parked

    @parked.setter
    def parked(self, on: bool) -> None:
        if on:
            self.park()
        else:
            self.unpark()

    @property
    def tracking(self) -> bool:
        """Whether the hour axis follows the stars."""
        return self._tracking

    @tracking.setter
    def tracking(self, on: bool) -> None:
        with self._lock:
            if on == self._tracking or (on and self.parked):
                return
            self._tracking = on
            change = SIDEREAL_DEG_S if on else -SIDEREAL_DEG_S
            self._axes[0].carry(self.clock.now_unix(), change)

    def _sign(self, direction: Direction) -> tuple[int, float]:
        """The axis and the way its angle goes; through the pole, north is backwards."""
        axis, sign = SIGNS[direction]
        return axis, -sign if axis == 1 and self._flipped else sign
