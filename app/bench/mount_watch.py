"""What a simulated mount was really told, against what the guard wrote down as sent."""

from dataclasses import dataclass, field
from datetime import datetime

from app.core.attitude import apart_deg
from app.core.earth import SIDEREAL_DEG_S
from app.core.mount import Direction, Epoch, PierSide, Pointing
from app.mounts.epoch import from_mount_epoch, to_mount_epoch
from app.mounts.guard import Guard
from app.mounts.motion_log import LogEntry
from app.simulate.mechanics.mount import EquatorialMount

TRACKING_DEG_S = 2.0 * SIDEREAL_DEG_S  # a bare motor follows the sky, guided or not
SAME_DEG = 0.02  # two writings of one place, the coarsest to 15 arcsec, nutation and aberration
LATE_S = 8.0  # a bare motor's goto ends in several turns


@dataclass(frozen=True, slots=True)
class Order:
    """One order that moves something: what, when (unix s), and its numbers."""

    kind: str
    unix_s: float
    place: tuple[float, float] = (0.0, 0.0)
    direction: str = ""


@dataclass(slots=True)
class Watched:
    """A :class:`~app.simulate.telescope.Telescope` that writes down every order that moves."""

    real: EquatorialMount
    orders: list[Order] = field(default_factory=list)

    def _note(
        self, kind: str, place: tuple[float, float] = (0.0, 0.0), direction: str = ""
    ) -> None:
        self.orders.append(Order(kind, self.real.clock.now_unix(), place, direction))

    def goto(self, ra_deg: float, dec_deg: float) -> str | None:
        """Begin a slew, or say why not."""
        self._note("goto", (ra_deg, dec_deg))
        return self.real.goto(ra_deg, dec_deg)

    def sync(self, ra_deg: float, dec_deg: float) -> str | None:
        """Believe to point here, or say why not."""
        self._note("sync", (ra_deg, dec_deg))
        return self.real.sync(ra_deg, dec_deg)

    def pulse(self, direction: Direction, milliseconds: float) -> None:
        """Move at the guide rate for so long."""
        self._note("pulse", direction=str(direction))
        self.real.pulse(direction, milliseconds)

    def move(self, direction: Direction, rate_deg_s: float) -> None:
        """Move until halted."""
        if rate_deg_s:
            self._note("move", direction=str(direction))
        self.real.move(direction, rate_deg_s)

    def turn_axis(self, axis: int, rate_deg_s: float) -> None:
        """A bare motor at this rate."""
        if (axis == 1 and rate_deg_s) or abs(rate_deg_s) > TRACKING_DEG_S:
            self._note("turn")
        self.real.turn_axis(axis, rate_deg_s)

    def turn_axis_to(self, axis: int, angle_deg: float) -> None:
        """A bare motor to this angle."""
        self._note("turn")
        self.real.turn_axis_to(axis, angle_deg)

    # What does not move is only passed on.

    @property
    def aligned(self) -> bool:
        """Whether it knows the sky."""
        return self.real.aligned

    @aligned.setter
    def aligned(self, on: bool) -> None:
        self.real.aligned = on

    @property
    def parked(self) -> bool:
        """Whether it has been parked."""
        return self.real.parked

    @parked.setter
    def parked(self, on: bool) -> None:
        if on:
            self._note("park")
        self.real.parked = on

    @property
    def tracking(self) -> bool:
        """Whether it follows the stars."""
        return self.real.tracking

    @tracking.setter
    def tracking(self, on: bool) -> None:
        self.real.tracking = on

    @property
    def latitude_deg(self) -> float:
        """Of the site it was told."""
        return self.real.latitude_deg

    @latitude_deg.setter
    def latitude_deg(self, degrees: float) -> None:
        self.real.latitude_deg = degrees

    @property
    def longitude_deg(self) -> float:
        """Of the site it was told."""
        return self.real.longitude_deg

    @longitude_deg.setter
    def longitude_deg(self, degrees: float) -> None:
        self.real.longitude_deg = degrees

    @property
    def slewing(self) -> bool:
        """Whether it moves fast."""
        return self.real.slewing

    @property
    def pier_side(self) -> PierSide:
        """The tube's side."""
        return self.real.pier_side

    def now_unix(self) -> float:
        """The mount's clock."""
        return self.real.now_unix()

    def sidereal_deg(self) -> float:
        """The mount's sidereal time."""
        return self.real.sidereal_deg()

    def believed_deg(self) -> tuple[float, float]:
        """Where it believes to point."""
        return self.real.believed_deg()

    def axes_deg(self) -> tuple[float, float]:
        """The encoders."""
        return self.real.axes_deg()

    def stop(self) -> None:
        """Stop every motion."""
        self.real.stop()

    def halt(self, direction: Direction | None = None) -> None:
        """End a move."""
        self.real.halt(direction)


def unguarded(orders: list[Order], guard: Guard) -> list[str]:
    """Every order that the guard's log does not account for, in words."""
    sent = [e for e in guard.log.entries if e.outcome == "sent"]
    left = list(sent)
    strays = []
    for order in orders:
        if order.kind == "turn":
            if not _under_way(order, guard):
                strays.append(f"a motor was turned at {order.unix_s:.1f}")
            continue
        match = next((e for e in left if _same(order, e, guard)), None)
        if match is None:
            strays.append(f"{order.kind} {order.place} {order.direction}".strip())
        else:
            left.remove(match)
    return strays


def _same(order: Order, entry: LogEntry, guard: Guard) -> bool:
    if entry.action != order.kind or _unix(entry) > order.unix_s + 0.1:
        return False
    if order.kind in ("goto", "sync"):
        when = datetime.fromisoformat(entry.time_utc)
        asked = Pointing(float(entry.detail["ra_deg"]), float(entry.detail["dec_deg"]), guard.epoch)
        place = to_mount_epoch(*from_mount_epoch(asked, when), Epoch.DATE, when)
        return apart_deg(place, order.place) < SAME_DEG
    return entry.detail.get("direction") == order.direction


def _under_way(order: Order, guard: Guard) -> bool:
    """Whether the last that the guard sent before is a motion that has not ended yet."""
    before = [e for e in guard.log.entries if _unix(e) <= order.unix_s + 0.1]
    motions = [e for e in before if e.action in ("goto", "move", "pulse", "stop")]
    if not motions:
        return False
    last = motions[-1]
    if last.outcome == "sent":
        return last.action != "stop"
    return last.outcome == "done" and order.unix_s - _unix(last) < LATE_S


def _unix(entry: LogEntry) -> float:
    return datetime.fromisoformat(entry.time_utc).timestamp()
