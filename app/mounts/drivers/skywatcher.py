"""Sky-Watcher's motor boards: the driver keeps the sky, the board only counts steps."""

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import RefusedError
from app.core.mount import Ability, Direction, MountState, PierSide, Pointing
from app.mounts.conversation import Reader
from app.mounts.drivers.base import SerialMount
from app.mounts.drivers.motors import Motor
from app.mounts.equatorial_axes import natural_side, to_axes, to_sky
from app.mounts.sky_frame import sidereal_deg, wrapped

SLEW_DEG_S = 3.0  # for foretelling where the sky will be
REACH_DEG = 100.0  # of the first axis from the counterweight's lowest place
CLOSE_DEG, APPROACHES = 2.0 / 3600.0, 4
GUIDE = 0.5


class SkyWatcher(SerialMount):
    """An equatorial mount over an EQDIR cable or USB, without a hand control.

    It starts from home: counterweight down, telescope at the pole. A sync is an offset of the
    axes that this driver keeps. Slews are finished, and tracking taken up again, while somebody
    asks for the state or position; left alone, the motors stand.
    """

    name = "skywatcher"
    title = "Sky-Watcher motor board (EQMOD, EQDIR)"
    blind_stop = b":L1\r:L2\r"
    bauds = (9600, 115200)
    timeout_s = 1.5
    rates_deg_s = (*(k * SIDEREAL_DEG_S for k in (0.5, 1, 8, 16, 64)), 0.5, 1.0, 3.0)

    def start(self) -> None:
        """Read what the motors are; nothing is switched on yet."""
        if self.site is None:
            raise RefusedError(
                "A motor board does not know where it stands: give the site, --site LAT,LON."
            )
        for ability in (Ability.SITE, Ability.TIME):
            self._lacks[ability] = "A motor board knows neither its site nor the time."
        self.motors = (Motor(self.talk, 0), Motor(self.talk, 1))
        self.version = self.motors[0].query("e")
        self.south = self.site.latitude_deg < 0.0
        self.offset_deg = (0.0, 0.0)
        self.tracking = self.motors[0].status().running
        self.target_deg: tuple[float, float] | None = None
        self.approaches = 0

    def identify(self) -> str:
        """The board's version."""
        version = f"{int(self.version[:2], 16)}.{int(self.version[2:4], 16):02d}"
        return f"Sky-Watcher motor board, version {version}"

    def position(self) -> Pointing:
        """From the encoders, the site and the clock."""
        self.deadman.check()
        self.go_on()
        hour_angle, dec, _ = to_sky(self.axes(), self.south)
        return Pointing((self.sidereal() - hour_angle) % 360.0, dec, self.epoch)

    def state(self) -> MountState:
        """Slewing until the target is reached."""
        self.go_on()
        return MountState(
            slewing=self.target_deg is not None,
            tracking=self.tracking,
            pier_side=self.side(),
        )

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Keep the difference of the axes."""
        side = self.side()
        wanted = to_axes(wrapped(self.sidereal() - ra_deg), dec_deg, side, self.south)
        axes = self.axes()
        self.offset_deg = (
            self.offset_deg[0] + wrapped(wanted[0] - axes[0]),
            self.offset_deg[1] + wrapped(wanted[1] - axes[1]),
        )

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Both motors to where the target will be."""
        since = self.talk.stops
        self.aim(ra_deg, dec_deg, 0.0)  # refuses before anything moves
        self.approaches = 0
        self.approach(ra_deg, dec_deg, since)
        self.target_deg = (ra_deg, dec_deg)
        self.tracking = True
        if since != self.talk.stops:  # the Stop came while the motors were being started
            self.target_deg = None

    def aim(self, ra_deg: float, dec_deg: float, ahead_s: float) -> tuple[float, float]:
        """Axes that will point there in ``ahead_s``, without lifting the counterweight."""
        hour_angle = wrapped(self.sidereal() + ahead_s * SIDEREAL_DEG_S - ra_deg)
        wanted = to_axes(hour_angle, dec_deg, natural_side(hour_angle), self.south)
        if abs(wanted[0]) > REACH_DEG:
            raise RefusedError(
                f"The hour axis would turn to {wanted[0]:.0f} deg, beyond its reach."
            )
        return wanted

    def approach(self, ra_deg: float, dec_deg: float, since: int) -> None:
        """Turn both motors by what is left."""
        for motor in self.motors:
            motor.stand()
        axes = self.axes()
        wanted = self.aim(ra_deg, dec_deg, 0.0)
        longest = max(abs(w - a) for w, a in zip(wanted, axes, strict=True))
        ahead = longest / SLEW_DEG_S + 0.3 if longest > 0.1 else 0.1
        wanted = self.aim(ra_deg, dec_deg, ahead)
        for motor, way in zip(
            self.motors, (w - a for w, a in zip(wanted, axes, strict=True)), strict=True
        ):
            motor.turn_by(way, since)

    def go_on(self) -> None:
        """Finish a slew that has come to its end; take up tracking that was interrupted."""
        if self.deadman.moving:
            return
        since = self.talk.stops
        target = self.target_deg
        if target is not None:
            if any(motor.status().running for motor in self.motors):
                return
            self.approaches += 1
            left = max(abs(w - a) for w, a in zip(self.aim(*target, 0.0), self.axes(), strict=True))
            if left > CLOSE_DEG and self.approaches < APPROACHES:
                self.approach(*target, since)
                return
            self.target_deg = None
        if self.tracking and not self.motors[0].status().running and since == self.talk.stops:
            self.motors[0].stand()
            self.motors[0].run(self.sky_rate(), since)

    def stop(self) -> None:
        """Both motors at once; tracking is taken up when the mount is asked next."""
        self.target_deg = None
        super().stop()
        self.target_deg = None  # a slew that was being prepared meanwhile

    def stop_words(self, moved: bool) -> list[tuple[bytes, tuple[Reader, ...]]]:
        """``L`` on both axes."""
        return [motor.halt_words(now=True) for motor in self.motors]

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """RA by another period while it tracks, Dec by a short turn."""
        self.need(Ability.PULSE)
        since = self.talk.stops
        seconds = milliseconds / 1000.0
        if direction in (Direction.NORTH, Direction.SOUTH):
            self.turn_dec(direction, GUIDE * SIDEREAL_DEG_S, seconds, since)
            return
        if not self.motors[0].status().running:
            raise RefusedError("A guide pulse in right ascension needs the mount to track.")
        factor = 1.0 + GUIDE if direction is Direction.WEST else 1.0 - GUIDE
        motor = self.motors[0]
        self.bounded(direction, seconds, motor.rate_words(self.sky_rate()))
        command, answers = motor.rate_words(self.sky_rate() * factor)
        self.talk.urge(command, *answers)

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest rate, on top of tracking; tracking goes on when asked next."""
        since = self.talk.stops
        rate = self.rates_deg_s[self.nearest_rate(rate_deg_s)]
        if direction in (Direction.NORTH, Direction.SOUTH):
            self.turn_dec(direction, rate, seconds, since)
            return
        motor = self.motors[0]
        over_sky = rate if direction is Direction.WEST else -rate
        sky = self.sky_rate() if self.tracking else 0.0
        motor.stand()
        self.bounded(direction, seconds, motor.halt_words())
        motor.run(sky + (-over_sky if self.south else over_sky), since)

    def turn_dec(self, direction: Direction, rate_deg_s: float, seconds: float, since: int) -> None:
        """The second motor for a bounded time."""
        north = direction is Direction.NORTH
        way = 1.0 if north is (self.side() is PierSide.WEST) else -1.0
        motor = self.motors[1]
        motor.stand()
        self.bounded(direction, seconds, motor.halt_words())
        motor.run(way * rate_deg_s, since)

    def track(self, on: bool) -> None:
        """Sidereal rate on the first motor."""
        self.tracking = on
        motor = self.motors[0]
        motor.stand()
        if on:
            motor.run(self.sky_rate(), self.talk.stops)

    def sky_rate(self) -> float:
        """The first motor's rate that follows the sky."""
        return -SIDEREAL_DEG_S if self.south else SIDEREAL_DEG_S

    def axes(self) -> tuple[float, float]:
        """Both angles with what syncs have taught."""
        first, second = (motor.angle_deg() for motor in self.motors)
        return first + self.offset_deg[0], second + self.offset_deg[1]

    def side(self) -> PierSide:
        """Of the pier."""
        return to_sky(self.axes(), self.south)[2]

    def sidereal(self) -> float:
        """Local sidereal time by our clock."""
        assert self.site is not None
        return sidereal_deg(self.site, self.clock())
