"""Celestron's AUX bus: the Wi-Fi of its mounts (TCP 2000), and the USB that some have themselves.

Only the two motor boards are spoken to. Each has one speed: tracking, a goto and a move replace one another, and rate
0 ends them all (INDIGO's record of a real mount). A goto ends by itself; moves at a rate, which do not, are never
sent. A hand control on the same bus orders the same motors, and what it knows of the sky is not told.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from math import copysign
from time import monotonic, sleep
from typing import TypeVar

from kochab.core.attitude import Degrees, wrapped
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Home, MountState, PierSide, TrackingRate
from kochab.gear.mounts.drivers.motor_mount import AT_HOME_DEG, MotorMount
from kochab.gear.mounts.drivers.nexstar import EQUATORIAL
from kochab.gear.mounts.protocols import nexstar as protocol
from kochab.gear.mounts.serial_line import Command, Conversation
from kochab.text.translation import tr, tr_noop

T = TypeVar("T")
TRIES = 2
SLOW_DEG, LONGEST_DEG = 0.1, 120.0  # shorter gotos are slow; longer ones go in parts, so that the way round is clear
SHORT_DEG = 0.5  # a goto that ends farther from its target was cut short
HOMED_DEG = 1.0  # a counter that goes from beyond this to zero without a goto was switched off and on
SEEN_S = 0.3  # long enough to see tracking
MODES = {TrackingRate.SIDEREAL: b"\xff\xff", TrackingRate.SOLAR: b"\xff\xfe", TrackingRate.LUNAR: b"\xff\xfd"}


class AuxMotor:
    """One motor board; see :class:`~kochab.gear.mounts.drivers.motor_mount.Motor`."""

    def __init__(self, talk: Conversation, board: int, timeout_s: float) -> None:
        self.talk, self.board, self.timeout_s = talk, board, timeout_s
        # 180 stands for "no goto yet"; near 0 it would pass for a goto to where a fresh counter stands.
        self.seen_deg, self.aimed_deg = 0.0, 180.0
        self.follows = self.under_way = False

    def ask(self, command: int, parse: Callable[[bytes], T], data: bytes = b"", since: int | None = None) -> T:
        """Ask or order; what is repeated when its answer is lost changes nothing more.

        Parameters
        ----------
        command : int
            Number of the motor board's command.
        parse : Callable[[bytes], T]
            Reads the answer's data.
        data : bytes
            The command's own bytes.
        since : int or None
            Count of Stops when a motion was decided: one in between wins; None for what moves nothing.
        """
        frame = protocol.aux(self.board, command, data)
        reader = protocol.aux_reader(frame, self.timeout_s)
        return self.talk.query(frame, reader, parse, TRIES, NoAnswerError, since)

    def angle_deg(self) -> float:
        """The counter."""
        self.seen_deg = self.ask(protocol.POSITION, protocol.parse_aux_angle)
        return self.seen_deg

    def running(self) -> bool:
        """Whether a goto is under way, or it follows the sky."""
        if self.under_way:
            self.under_way = not self.ask(protocol.SLEW_DONE, protocol.parse_aux_done)
        return self.under_way or self.follows

    def fell_short(self) -> bool:
        """Whether the last goto did not end at its target."""
        return abs(wrapped(self.seen_deg - self.aimed_deg)) > SHORT_DEG

    def turn_by(self, angle_deg: float, since: int) -> None:
        """A goto by so much from the angle read last, at most by a third of a turn."""
        turn_deg = max(-LONGEST_DEG, min(LONGEST_DEG, angle_deg))
        self.aimed_deg = self.seen_deg + turn_deg
        command = protocol.GOTO_FAST if abs(turn_deg) > SLOW_DEG else protocol.GOTO_SLOW
        # Before the order: if its answer is lost the board may have begun, and running() asks.
        self.under_way = True
        self.ask(command, protocol.parse_aux, protocol.aux_angle(self.aimed_deg), since)

    def run(self, rate: TrackingRate, backwards: bool, since: int) -> None:
        """Follow the sky until stopped."""
        command = protocol.GUIDE_NEGATIVE if backwards else protocol.GUIDE_POSITIVE
        self.ask(command, protocol.parse_aux, MODES[rate], since)
        self.follows = True

    def halt_command(self, now: bool = False) -> Command:
        """Rate 0, which is always at once."""
        frame = protocol.aux(self.board, protocol.POSITIVE, b"\0")
        return frame, (protocol.aux_reader(frame, self.timeout_s),)

    def ensure_stopped(self) -> None:
        """The same, and answered."""
        self.ask(protocol.POSITIVE, protocol.parse_aux, b"\0")
        self.under_way = self.follows = False


UNKNOWN = tr_noop("Kochab does not know this Celestron (model {model}): use its hand control (--driver nexstar).")
NOT_ALT_AZIMUTH = tr_noop(
    "Kochab can't slew this mount ({model}) in altitude and azimuth directly: use its hand control (--driver nexstar)."
    " If it is on a wedge, connect as equatorial (--equatorial)."
)
NO_FORK_IN_SOUTH = tr_noop(
    "South of the equator Kochab can't slew a fork on a wedge directly: use its hand control (--driver nexstar)."
)


class CelestronAux(MotorMount):
    """A German mount, or a fork on a wedge in the north; a fork in altitude and azimuth is refused.

    The axes count as a Sky-Watcher's do (INDI's celestronaux.cpp); those of a fork are hour angle and declination.
    """

    name = "celestronaux"
    title = "Celestron Wi-Fi or USB (AUX bus)"
    blind_stop = b"".join(protocol.aux(board, protocol.POSITIVE, b"\0") for board in (protocol.AZM, protocol.ALT))
    tcp_port = 2000
    timeout_s = 1.0
    motors: tuple[AuxMotor, AuxMotor]

    def find_motors(self) -> bool:
        """By the model; whether it tracks is seen."""
        self.fault, self.took_s, self.ordered_s = "", 0.0, 0.0
        azm, alt = (AuxMotor(self.talk, board, self.timeout_s) for board in (protocol.AZM, protocol.ALT))
        self.motors = azm, alt
        self.version = azm.ask(protocol.AUX_VERSION, lambda reply: protocol.parse_aux(reply, 2, 4))
        self.model = 0
        with suppress(NoAnswerError):  # some refuse it
            self.model = azm.ask(protocol.AUX_MODEL, lambda reply: protocol.parse_aux(reply, 2))[0]
        if objection := self.objection():
            raise RefusedError(objection)
        self.wedge = protocol.MODELS[self.model] not in EQUATORIAL
        if self.wedge:
            self.reach_deg = 360.0
        self._lacks[Ability.KING] = tr_noop("A Celestron has no King rate.")
        # No question tells whether it tracks: see whether the counter turns as the sky does.
        before, _ = self.counters()
        sleep(SEEN_S)
        turned = wrapped(azm.angle_deg() - before) * (-1.0 if self.south else 1.0)
        # More than half the sky's turn is tracking; a tenth of a degree in 0.3 s is a slew.
        azm.follows = 0.5 * SIDEREAL_DEG_S * SEEN_S < turned < AT_HOME_DEG
        return azm.follows

    def objection(self) -> str:
        """Why this mount must not be driven; empty when it may."""
        model = protocol.MODELS.get(self.model)
        if model is None:
            return tr(UNKNOWN, model=self.model)
        if model in EQUATORIAL:
            return ""
        if not self.equatorial:
            return tr(NOT_ALT_AZIMUTH, model=model)
        return tr(NO_FORK_IN_SOUTH) if self.south else ""

    def identify(self) -> str:
        """Model and version."""
        model, version = protocol.MODELS[self.model], f"{self.version[0]}.{self.version[1]:02d}"
        return tr("Celestron {model}, motor board {version}", model=model, version=version)

    def board_id(self) -> str:
        """Model and version."""
        return f"{self.model}-{self.version.hex()}"

    def confirmed_offset(self, home: Home) -> Degrees:
        """The same for a German mount; a fork has no home that fixes its hour angle."""
        if self.wedge:
            raise RefusedError("A fork on a wedge learns where it points from a solved frame: connect without --home.")
        return super().confirmed_offset(home)

    def offset_from_sky(self, hour_angle_deg: float, dec_deg: float) -> Degrees:
        """The same; a fork has one way to point at a place."""
        if not self.wedge:
            return super().offset_from_sky(hour_angle_deg, dec_deg)
        first, second = self.counters()
        return hour_angle_deg - first, dec_deg - second

    def counters(self) -> Degrees:
        """Both angles as the boards count them; `RefusedError` when they begin anew."""
        # A counter at zero is no sign of a power cycle if it was near zero before, or was sent there.
        before = [abs(motor.seen_deg) > HOMED_DEG and abs(motor.aimed_deg) > SHORT_DEG for motor in self.motors]
        counters = super().counters()
        if any(before) and all(abs(angle) < AT_HOME_DEG for angle in counters):
            self.lost_power()
        return counters

    def arrived(self) -> bool:
        """A board may end its goto elsewhere, at its limits or because it was switched on, and say that it is done."""
        self.counters()
        self.took_s = monotonic() - self.ordered_s
        self.fault = tr_noop("a motor stopped by itself") if any(motor.fell_short() for motor in self.motors) else ""
        return not self.fault

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Both motors to where the target will be."""
        self.fault, self.took_s = "", 0.0
        super().goto(ra_deg, dec_deg)

    def approach(self, ra_deg: float, dec_deg: float, since: int) -> None:
        """The same, timed: how long a slow goto takes no source tells."""
        self.ordered_s = monotonic()
        super().approach(ra_deg, dec_deg, since)

    def aim(self, ra_deg: float, dec_deg: float, ahead_s: float) -> Degrees:
        """The same, as far ahead as the last part of the slew took; a fork goes the shorter way round."""
        # An ahead_s of 0 asks for the place right now, to see what is left.
        first, second = super().aim(ra_deg, dec_deg, ahead_s and max(ahead_s, self.took_s))
        here = self.motors[0].seen_deg + self.offset_deg[0]
        return (wrapped(here) + wrapped(first - here) if self.wedge else first), second

    def axes(self) -> Degrees:
        """Both angles with the offset of the last sync, in [-180, 180)."""
        first, second = super().axes()
        return wrapped(first), wrapped(second)

    def to_sky(self, axes_deg: Degrees) -> tuple[float, float, PierSide]:
        """Hour angle, declination and side of the pier; a fork's declination grows as that of a tube in the west."""
        if not self.wedge:
            return super().to_sky(axes_deg)
        hour_angle, dec = axes_deg
        if abs(dec) > 90.0:  # through the pole
            hour_angle, dec = hour_angle + 180.0, copysign(180.0, dec) - dec
        return wrapped(hour_angle), dec, PierSide.WEST

    def to_axes(self, hour_angle_deg: float, dec_deg: float, side: PierSide) -> Degrees:
        """The angles that point there."""
        return (hour_angle_deg, dec_deg) if self.wedge else super().to_axes(hour_angle_deg, dec_deg, side)

    def state(self) -> MountState:
        """The same; a fork has no side, and a goto that ended early is told."""
        state = super().state()
        return replace(state, pier_side=None if self.wedge else state.pier_side, fault=self.fault or None)

    def track(self, rate: TrackingRate) -> None:
        """The same, at a rate it has."""
        self.require(rate.ability)
        super().track(rate)

    def follow(self, since: int) -> None:
        """The same; a hand control that tracked in altitude may have left the other motor turning."""
        self.motors[1].ensure_stopped()
        super().follow(since)

    def stop_commands(self) -> list[Command]:
        """Rate 0 on both axes."""
        for motor in self.motors:
            motor.under_way = motor.follows = False
        return super().stop_commands()
