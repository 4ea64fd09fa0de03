"""Mounts whose controllers only count steps, as Sky-Watcher's and Celestron's: the driver keeps the coordinates.

A controller does not know where its tube points. Switched on, it counts from the middle on both axes wherever they
stand. So nothing slews until the user or a solved frame has confirmed home.
"""

import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import ClassVar, NoReturn, Protocol

from kochab.core.attitude import Degrees, apart_deg, wrapped
from kochab.core.errors import DeviceError, RefusedError, StoppedError
from kochab.core.mount import (
    CONFIRM_HOME,
    SIDEREAL_DEG_S,
    Ability,
    Direction,
    Home,
    MountState,
    PierSide,
    Pointing,
    TrackingRate,
)
from kochab.core.values import frozen
from kochab.gear.mounts.drivers.serial_mount import SerialMount
from kochab.gear.mounts.kept_by_line import kept_file
from kochab.gear.mounts.serial_line import Command
from kochab.parsing.text_input import read_json
from kochab.sky.horizon import sidereal_deg
from kochab.text.translation import tr_noop

# -- From encoder angles to hour angle and declination, and back -------------------------------
# Both angles are zero at home. The first grows as the sky turns in the north, and shrinks in the
# south. With the second at or below zero the telescope is west of its pier, else east (as EQMOD).


def to_sky(axes_deg: Degrees, south: bool) -> tuple[float, float, PierSide]:
    """Hour angle in [-180, 180), declination and side of the pier."""
    first, second = axes_deg[0], wrapped(axes_deg[1])
    west = second <= 0.0
    # With the counterweight down (first angle 0) a tube west of the pier, turned off the pole, looks at -6 h.
    hour_angle = first - 90.0 if west else first + 90.0
    dec = 90.0 - abs(second)
    side = PierSide.WEST if west else PierSide.EAST
    return (wrapped(-hour_angle), -dec, side.opposite) if south else (wrapped(hour_angle), dec, side)


def to_axes(hour_angle_deg: float, dec_deg: float, side: PierSide, south: bool) -> Degrees:
    """Encoder angles, degrees, that point there.

    Parameters
    ----------
    hour_angle_deg : float
        West positive, degrees.
    dec_deg : float
        Declination, degrees.
    side : PierSide
        Of the pier that the tube is to be on.
    south : bool
        Whether the mount stands south of the equator.
    """
    if south:
        hour_angle_deg, dec_deg, side = -hour_angle_deg, -dec_deg, side.opposite
    # The inverse of to_sky: west of the pier the second angle runs from 0 at the pole to negative.
    if side is PierSide.WEST:
        return wrapped(hour_angle_deg + 90.0), dec_deg - 90.0
    return wrapped(hour_angle_deg - 90.0), 90.0 - dec_deg


def natural_side(hour_angle_deg: float) -> PierSide:
    """West of the pier for what is east of the meridian: the counterweight stays below."""
    return PierSide.WEST if hour_angle_deg < 0.0 else PierSide.EAST


NO_PARK = tr_noop("This mount knows no park position: slew where you want it, then stop tracking.")
SLEW_DEG_S = 3.0  # assumed, to predict where the target will be
REACH_DEG = 105.0  # how far the RA axis may turn from counterweight down
CLOSE_DEG, APPROACHES = 2.0 / 3600.0, 4
LEAST_S, RESUMES_S = 1.0, 0.5  # a short goto is over by then; tracking resumes so long after it

AT_HOME_DEG = 0.1  # a counter that was set there and has not turned since
AGREES_DEG = 15.0  # home is set by eye, and the polar axis may be some degrees off
NUDGE_DEG = 2.0  # the longest move while home is not confirmed
BESIDE_POLE_DEG = 5.0  # this near the pole the second angle doesn't show the pier side


@frozen
class KeptZero:
    """The offset of both axes and what the counters read with it, degrees, for the next program.

    A controller has no number and no clock, but one that was switched off counts from the middle: counters that read
    as they were left belong to the same power cycle.
    """

    offset_deg: Degrees
    counters_deg: Degrees
    tracking: bool
    unix_s: float

    def holds(self, counters_deg: Degrees, sky_rate: float, unix_s: float) -> bool:
        """Whether nothing but tracking has turned the motors since; counters as at power-on prove nothing."""
        drift = sky_rate * (unix_s - self.unix_s) if self.tracking else 0.0
        turned = counters_deg[0] - self.counters_deg[0], counters_deg[1] - self.counters_deg[1]
        within = min(0.0, drift) - AT_HOME_DEG <= turned[0] <= max(0.0, drift) + AT_HOME_DEG
        return within and abs(turned[1]) < AT_HOME_DEG and abs(drift) < 180.0


def reads(zero: Degrees, counters_deg: Degrees) -> bool:
    """Whether the counters stand at this home."""
    return all(abs(c + z) < AT_HOME_DEG for c, z in zip(counters_deg, zero, strict=True))


class Motor(Protocol):
    """One axis, 0 or 1, whose angles are degrees from where its counter is zero."""

    @property
    def seen_deg(self) -> float:
        """The counter when it was read last."""

    def angle_deg(self) -> float:
        """The counter."""

    def running(self) -> bool:
        """Whether it turns."""

    def turn_by(self, angle_deg: float, since: int) -> None:
        """A goto by so much from the angle read last; the motor must stand."""

    def run(self, rate: TrackingRate, backwards: bool, since: int) -> None:
        """Follow the sky until stopped; the motor must stand."""

    def halt_command(self, now: bool = False) -> Command:
        """The bytes that stop it, at once or with a ramp."""

    def ensure_stopped(self) -> None:
        """Stop it if it runs."""


class MotorMount(SerialMount):
    """An equatorial mount without a hand control.

    A sync is an offset of the axes that this driver keeps, and the next one of the same power cycle takes over. A
    slew is finished, and tracking resumed after a move, when the state or position is read next. After a Stop the
    motors stand until tracking or a slew is ordered.
    """

    zeros_at: ClassVar[dict[Home, Degrees]] = {Home.POWER_ON: (0.0, 0.0)}
    """Home -> the offset of both axes, degrees, that makes home zero."""
    ends_alone = True
    rates_deg_s = (*(k * SIDEREAL_DEG_S for k in (0.5, 1, 8, 16, 64)), 0.5, 1.0, 3.0)
    motors: tuple[Motor, Motor]
    reach_deg = REACH_DEG

    def start(self) -> None:
        """Read the motors' parameters; nothing is switched on yet."""
        if self.site is None:
            raise RefusedError("This mount stores no site: give --site LAT,LON.")
        self._lacks[Ability.PULSE] = tr_noop("This mount is nudged by short gotos that stop by themselves.")
        for ability in (Ability.SITE, Ability.TIME, Ability.SET_SITE, Ability.SET_CLOCK):
            self._lacks[ability] = tr_noop("This mount stores neither site nor time.")
        tracks = dict.fromkeys((rate.ability for rate in TrackingRate), b"")
        self.use_commands(tracks, NO_PARK)
        self.south, self.rate = self.site.latitude_deg < 0.0, TrackingRate.SIDEREAL
        self.target_deg: Degrees | None = None
        self.target_side = PierSide.WEST
        self.approaches = 0
        self.offset_deg: Degrees = (0.0, 0.0)
        self.home_confirmed = self.home is not None
        self.zeros = list(self.zeros_at.values())
        self.tracking = self.find_motors()
        if self.home is not None:
            self.offset_deg = self.confirmed_offset(self.home)
        elif (kept := self.recall()) and self.same_power():
            self.zeros.append(kept.offset_deg)
            # Any board that was just switched on reads this, wherever its tube is.
            fresh = any(reads(zero, kept.counters_deg) for zero in self.zeros_at.values())
            if not fresh and kept.holds(self.counters(), self.sky_rate, self.clock().timestamp()):
                self.offset_deg, self.home_confirmed = kept.offset_deg, True

    def find_motors(self) -> bool:
        """Make :attr:`motors`; whether they track."""
        raise NotImplementedError

    def same_power(self) -> bool:
        """Whether the counters may be those of the last program, as far as the controller tells."""
        return True

    def board_id(self) -> str:
        """What tells this mount from others on the same port."""
        raise NotImplementedError

    def confirmed_offset(self, home: Home) -> Degrees:
        """The offset of the home that the user confirms; refused when the counters contradict it."""
        if home is Home.NOW:
            if any(motor.running() for motor in self.motors):
                raise RefusedError("The mount is moving: stop it before you confirm its home.")
            first, second = self.counters()
            return -first, -second
        if home not in self.zeros_at:
            raise RefusedError("This mount has no home of {home}: use --home now.", home=home)
        # Counters at a home other than the one confirmed would put Dec off by a quarter turn.
        for other, zero in self.zeros_at.items():
            if other is not home and reads(zero, self.counters()):
                raise RefusedError(
                    "The motor counters match the home position of {other}, not {home}. Point the tube at the "
                    "pole, counterweight down, and connect with --home now.",
                    other=other,
                    home=home,
                )
        return self.zeros_at[home]

    def offset_from_sky(self, hour_angle_deg: float, dec_deg: float) -> Degrees:
        """The offset of the home that the counters were set at, by a solved position.

        The position alone does not show the side of the pier; counters that fit do.
        """
        counters = self.counters()
        for zero in self.zeros:
            hour_angle, dec, _ = self.to_sky((counters[0] + zero[0], counters[1] + zero[1]))
            if apart_deg((hour_angle, dec), (hour_angle_deg, dec_deg)) <= AGREES_DEG:
                return zero
        raise RefusedError(
            "The motor counters match no home position, so the pier side is unknown. Point the tube at "
            "the pole, counterweight down, and connect with home confirmed (--home now)."
        )

    def kept_file(self) -> Path | None:
        """Where the zero of this mount is kept."""
        if self.kept is None:
            return None
        return kept_file(self.kept, self.talk.link.port, str(self.board_id()))

    def recall(self) -> KeptZero | None:
        """What the last program saved; None when the file is damaged."""
        with suppress(ValueError, TypeError):
            return KeptZero(**read_json(file)) if (file := self.kept_file()) else None
        return None

    def keep(self) -> None:
        """Save the zero point and the last counters read; a full disk does not stop the mount's work."""
        file = self.kept_file()
        if file is None or not self.home_confirmed:
            return
        first, second = (motor.seen_deg for motor in self.motors)
        kept = KeptZero(self.offset_deg, (first, second), self.tracking, self.clock().timestamp())
        with suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(asdict(kept)), "utf-8")

    def close(self) -> None:
        """Keep what the counters mean, and give the port back."""
        with suppress(DeviceError):
            if self.watchdog.moving:
                self.stop()
            self.counters()
            self.keep()
        super().close()

    def lost_power(self) -> NoReturn:
        """The mount was switched off and on: nothing goes on, and its home is open again."""
        self.target_deg, self.tracking, self.home_confirmed, self.offset_deg = None, False, False, (0.0, 0.0)
        raise RefusedError(
            "The mount was switched off and on: Kochab no longer knows where it points. Sync on a solved frame, or"
            " connect again with home confirmed (--home now)."
        )

    def require_home(self) -> None:
        """Raise while the home is not confirmed."""
        if not self.home_confirmed:
            raise RefusedError(CONFIRM_HOME)

    def position(self) -> Pointing:
        """From the encoders, the site and the clock."""
        self.watchdog.check()
        self.continue_motion()
        hour_angle, dec, _ = self.to_sky(self.axes())
        return Pointing((self.sidereal() - hour_angle) % 360.0, dec, self.epoch)

    def state(self) -> MountState:
        """Slewing until the target is reached."""
        self.continue_motion()
        return MountState(
            slewing=self.target_deg is not None,
            tracking=self.tracking,
            pier_side=self.side() if self.home_confirmed else None,
            home_confirmed=self.home_confirmed,
            rate=self.rate,
            alt_azimuth=False,  # alt-azimuth mounts are refused
        )

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Keep the difference of the axes; the first one confirms home, where the counters fit."""
        hour_angle = wrapped(self.sidereal() - ra_deg)
        if not self.home_confirmed:
            self.offset_deg = self.offset_from_sky(hour_angle, dec_deg)
            self.home_confirmed = True
        axes = self.axes()
        at, dec, side = self.to_sky(axes)
        # Beside the pole either side is possible: take the one that turns the RA axis less.
        sides = tuple(PierSide) if abs(wrapped(axes[1])) < BESIDE_POLE_DEG else (side,)
        # The sync is the difference between where the axes are and where they would have to be.
        wanted = (self.to_axes(hour_angle, dec_deg, one) for one in sides)
        turns = [(wrapped(w[0] - axes[0]), wrapped(w[1] - axes[1])) for w in wanted]
        first, second = min(turns, key=lambda turn: abs(turn[0]))
        # A small step on the sky, but a large turn of the RA axis.
        if abs(first) > AGREES_DEG >= apart_deg((at, dec), (hour_angle, dec_deg)):
            raise RefusedError(
                "So near the pole this sync would turn the RA axis by {turn:+.0f}°. Home is confirmed: slew to a star"
                " farther from the pole and sync there.",
                turn=first,
            )
        self.offset_deg = self.offset_deg[0] + first, self.offset_deg[1] + second
        self.keep()

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Both motors to where the target will be."""
        self.require_home()
        since = self.talk.stops
        self.target_side = self.side_for(ra_deg)
        self.aim(ra_deg, dec_deg, 0.0)  # refuses before anything moves
        self.approaches = 0
        self.approach(ra_deg, dec_deg, since)
        self.target_deg = (ra_deg, dec_deg)
        self.tracking = True
        if since != self.talk.stops:  # the Stop came while the motors were being started
            self.target_deg, self.tracking = None, False

    def side_for(self, ra_deg: float) -> PierSide:
        """The side a slew ends on: with the counterweight down, but the present one where no meridian is crossed."""
        here, _, side = self.to_sky(self.axes())
        natural = natural_side(wrapped(self.sidereal() - ra_deg))
        return side if natural_side(here) is natural else natural

    def aim(self, ra_deg: float, dec_deg: float, ahead_s: float) -> Degrees:
        """Axes that will point there in ``ahead_s``, from the side of the slew."""
        hour_angle = wrapped(self.sidereal() + ahead_s * SIDEREAL_DEG_S - ra_deg)
        wanted = self.to_axes(hour_angle, dec_deg, self.target_side)
        if abs(wanted[0]) > self.reach_deg:
            raise RefusedError(
                "The RA axis would turn to {axis:.0f}°, beyond its limit: a flip is due. Slew back across"
                " the meridian first, then flip from there.",
                axis=wanted[0],
            )
        return wanted

    def approach(self, ra_deg: float, dec_deg: float, since: int) -> None:
        """Turn both motors by what is left."""
        for motor in self.motors:
            motor.ensure_stopped()
        axes = self.axes()
        wanted = self.aim(ra_deg, dec_deg, 0.0)
        longest = max(abs(w - a) for w, a in zip(wanted, axes, strict=True))
        # The sky turns meanwhile: send both motors to where the target will be.
        ahead = longest / SLEW_DEG_S + 0.3 if longest > 0.1 else 0.1
        wanted = self.aim(ra_deg, dec_deg, ahead)
        try:
            for motor, to, axis in zip(self.motors, wanted, axes, strict=True):
                motor.turn_by(to - axis, since)
        except RefusedError:
            for motor in self.motors:  # the first may turn, and after a refusal nobody would watch it
                motor.ensure_stopped()
            raise

    def continue_motion(self) -> None:
        """Finish a slew whose motors have stopped; resume tracking after a move."""
        # While a move is under way its motor must be sent nothing else.
        if self.watchdog.moving:
            return
        with suppress(StoppedError):  # a question for the position must not raise the Stop of a motion
            self.finish_slew()

    def finish_slew(self) -> None:
        """The rest of the slew, then tracking; a Stop meanwhile is `StoppedError`."""
        since = self.talk.stops
        target = self.target_deg
        if target is not None:
            if any(motor.running() for motor in self.motors):
                return
            if not self.arrived():
                self.target_deg, self.tracking = None, False
                return
            self.approaches += 1
            # The slew took longer or shorter than predicted, so the sky has moved: approach again, by ever less.
            left = max(abs(w - a) for w, a in zip(self.aim(*target, 0.0), self.axes(), strict=True))
            if left > CLOSE_DEG and self.approaches < APPROACHES:
                self.approach(*target, since)
                return
            self.target_deg = None
            self.keep()
        if self.tracking and not self.motors[0].running() and since == self.talk.stops:
            self.follow(since)

    def arrived(self) -> bool:
        """Whether the motors ended where they were sent, as far as this can be seen."""
        return True

    def follow(self, since: int) -> None:
        """The first motor at the rate of tracking."""
        self.motors[0].ensure_stopped()
        self.motors[0].run(self.rate, self.south, since)

    def stop(self) -> None:
        """Both motors at once; they stand until tracking or a slew is ordered."""
        self.target_deg, self.tracking = None, False
        super().stop()
        self.target_deg, self.tracking = None, False  # another thread may have set them meanwhile

    def stop_commands(self) -> list[Command]:
        """At once, on both axes."""
        return [motor.halt_command(now=True) for motor in self.motors]

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """By as much, as a short goto that the board itself ends; tracking resumes at the next question after it."""
        since = self.talk.stops
        seconds, angle = max(seconds, LEAST_S), self.rates_deg_s[self.nearest_rate(rate_deg_s)] * seconds
        if angle > NUDGE_DEG:
            self.require_home()
        # West of the pier the second angle grows to the north, east of it to the south.
        if direction.in_dec:
            turn = angle if (direction is Direction.NORTH) is (self.side() is PierSide.WEST) else -angle
        else:
            turn = angle if (direction is Direction.WEST) is not self.south else -angle
            # The axis doesn't track during the goto, so the goto makes up for the sky's turn.
            turn += self.sky_rate * (seconds + RESUMES_S) if self.tracking else 0.0
        motor = self.motors[direction.in_dec]
        motor.ensure_stopped()
        # turn_by() starts from the angle read last, which must be of a motor that stands.
        motor.angle_deg()
        with self.bounded(direction, seconds, motor.halt_command()):
            motor.turn_by(turn, since)

    @property
    def sky_rate(self) -> float:
        """Of the first motor."""
        return -self.rate.deg_s if self.south else self.rate.deg_s

    def track(self, rate: TrackingRate) -> None:
        """The first motor at this rate."""
        since = self.talk.stops
        self.tracking = rate is not TrackingRate.OFF
        if self.tracking:
            self.rate = rate
            self.follow(since)
        else:
            self.motors[0].ensure_stopped()

    def counters(self) -> Degrees:
        """Both angles as the board counts them."""
        first, second = (motor.angle_deg() for motor in self.motors)
        return first, second

    def axes(self) -> Degrees:
        """Both angles with the offset of the last sync."""
        first, second = self.counters()
        return first + self.offset_deg[0], second + self.offset_deg[1]

    def side(self) -> PierSide:
        """The side of the pier."""
        return self.to_sky(self.axes())[2]

    def to_sky(self, axes_deg: Degrees) -> tuple[float, float, PierSide]:
        """Hour angle, declination and side of the pier of a German mount."""
        return to_sky(axes_deg, self.south)

    def to_axes(self, hour_angle_deg: float, dec_deg: float, side: PierSide) -> Degrees:
        """The angles that point there."""
        return to_axes(hour_angle_deg, dec_deg, side, self.south)

    def sidereal(self) -> float:
        """Local sidereal time by our clock."""
        assert self.site is not None
        return sidereal_deg(self.site, self.clock())
