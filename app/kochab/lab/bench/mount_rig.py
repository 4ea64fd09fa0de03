"""One practice telescope behind a real line, for runs by the hundred: time jumps where it may.

The mount's clock runs as fast as the wall's while bytes are under way or a motion is timed by this computer; all
other waiting, and exposures, are jumps. A line that is silent is given up after half a second instead of five.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from math import inf
from typing import Any

import numpy as np

from kochab.core.attitude import apart_deg
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Epoch, Home, Pointing
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen, mutable
from kochab.gear.journal import LogEntry
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.gear.mounts.drivers.serial_mount import SerialMount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.responders import open_responder
from kochab.simulate.rig import PracticeRig, misaligned, practice_night, random_place, tonight
from kochab.simulate.serial_line import Fault, Faults, Line, pty_line, socket_line
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections, solve_frame
from kochab.workflows.goto_target import Target, target_at

# -- The orders that a simulated mount received, against those that the guard logged as sent ----

TRACKING_DEG_S = 2.0 * SIDEREAL_DEG_S  # a bare motor follows the sky, guided or not
SAME_DEG = 0.02  # two writings of one place, the coarsest to 15 arcsec, nutation and aberration
LATEST_STOP_S = 8.0  # a bare motor's goto ends in several turns


@frozen
class ReceivedOrder:
    """One order that moves something: what, when (unix s), and what was ``given`` with it."""

    kind: str
    unix_s: float
    given: tuple[Any, ...] = ()


ORDERS: dict[str, Callable[..., bool]] = {
    **dict.fromkeys(("goto", "sync", "pulse", "park", "turn_axis_to"), lambda *_: True),
    "move": lambda _, rate_deg_s: rate_deg_s != 0.0,
    "turn_axis": lambda axis, rate_deg_s: (axis == 1 and rate_deg_s != 0.0) or abs(rate_deg_s) > TRACKING_DEG_S,
}
"""What a mount can be told, and whether that moves it."""


class WatchedMount(EquatorialMount):
    """A simulated mount that writes down every order that moves it."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.orders: list[ReceivedOrder] = []
        for name, moves in ORDERS.items():
            setattr(self, name, self._noting(name, moves))

    def _noting(self, name: str, moves: Callable[..., bool]) -> Callable[..., Any]:
        attribute = getattr(self, name)

        def obey(*given: Any) -> Any:
            if moves(*given):
                self.orders.append(ReceivedOrder(name, self.clock.now_unix(), given))
            return attribute(*given)

        return obey


def unguarded(orders: list[ReceivedOrder], guard: Guard) -> list[str]:
    """Every order that the guard's log does not account for, in words."""
    # Each entry of the log accounts for one order, so two orders for one entry are a stray.
    left = [e for e in guard.log.entries if e.outcome == "sent"]
    strays = []
    for order in orders:
        if order.kind.startswith("turn"):
            if not _under_way(order, guard):
                strays.append(f"a motor was turned at {order.unix_s:.1f}")
            continue
        match = next((e for e in left if _same(order, e, guard)), None)
        if match is None:
            strays.append(" ".join(map(str, (order.kind, *order.given))))
        else:
            left.remove(match)
    return strays


def _same(order: ReceivedOrder, entry: LogEntry, guard: Guard) -> bool:
    if entry.action != order.kind or _unix(entry) > order.unix_s + 0.1:
        return False
    if order.kind in ("goto", "sync"):
        when = datetime.fromisoformat(entry.time_utc)
        asked = Pointing(float(entry.detail["ra_deg"]), float(entry.detail["dec_deg"]), guard.epoch)
        place = to_mount_epoch(*from_mount_epoch(asked, when), Epoch.DATE, when)
        return apart_deg(place, (order.given[0], order.given[1])) < SAME_DEG
    return not order.given or entry.detail.get("direction") == str(order.given[0])


def _under_way(order: ReceivedOrder, guard: Guard) -> bool:
    """Whether the last that the guard sent before is a motion that has not ended yet."""
    motions = [e for e in guard.log.entries if e.action in ("goto", "move", "pulse", "stop")]
    last = next((e for e in reversed(motions) if _unix(e) <= order.unix_s + 0.1), None)
    if last is None:
        return False
    if last.outcome == "sent":
        return last.action != "stop"
    return last.outcome == "done" and order.unix_s - _unix(last) < LATEST_STOP_S


def _unix(entry: LogEntry) -> float:
    return datetime.fromisoformat(entry.time_utc).timestamp()


SITES = (Site(47.0, 8.0, 450.0), Site(-33.0, 151.0, 60.0))
DATE_UNIX = 1_800_000_000.0
LOST_DEG = 3.0
EXPOSURE_S = 2.0
PATIENCE_S, LATE_S = 0.5, 0.7
HEARD_S = 0.05
STALL_S = 0.1  # what the night counts of a longer wait for a busy computer
UNANSWERED = ("pulse", "move", "stop")
CHANCES = {Fault.SILENCE: 0.01, Fault.GARBAGE: 0.01, Fault.LATE: 0.01, Fault.SPLIT: 0.03, Fault.WRONG: 0.01}


@mutable
class MountRig:
    """A rig, the line to its mount, and the guard around the driver at the other end."""

    rig: PracticeRig
    line: Line
    faults: Faults
    guard: Guard
    watched: WatchedMount
    target: Target
    rendered: bool
    exposed_unix: float = 0.0
    unplug_in: int = 0  # waits from now on
    timed: bool = False  # a motion that this computer ends has been under way

    def wait(self, seconds: float) -> None:
        """Jump, unless this computer is timing a motion."""
        self.unplug_in -= 1
        if self.unplug_in == 0:
            self.faults.next(Fault.UNPLUG)
        mount = self.guard.mount
        if isinstance(mount, SerialMount) and mount.watchdog.moving:
            self.timed = True
            self.rig.clock.most_s = inf
            time.sleep(seconds)
            # The clock is read so that the time slept counts whole, before most_s cuts it again.
            self.rig.clock.now_unix()
            self.rig.clock.most_s = STALL_S
            return
        last = self.guard.log.entries[-1:]
        if self.timed or any(entry.action in UNANSWERED for entry in last):
            time.sleep(HEARD_S)  # the bytes that begin or end a motion may still be under way
            self.timed = False
        self.rig.clock.step(seconds)

    def solve_now(self) -> Task[Solution | NoSolution]:
        """A fresh frame, or for most runs the list of stars that its detector would give."""
        clock = self.rig.clock
        # The night stands still while a frame is rendered, however long this computer takes for it.
        clock.set_rate(0.0)
        try:
            if self.rendered:
                frame = self.rig.frame(EXPOSURE_S)
            else:
                stars, hint = self.rig.star_list(EXPOSURE_S)
            self.exposed_unix = clock.now_unix() - EXPOSURE_S / 2.0
        finally:
            clock.set_rate(1.0)
        if self.rendered:
            return (yield from solve_frame(frame))
        return (yield from solve_detections(stars, SolveOptions(hint=hint)))

    def spoil(self, refusal: bool) -> None:
        """Let the line be as bad as lines are, from now on; ``refusal`` of the next order too."""
        for fault, chance in CHANCES.items():
            self.faults.chance(fault, chance)
        if refusal:
            self.faults.next(Fault.REFUSAL)


FarEnd = Callable[[str, EquatorialMount], Any]
"""The simulated controller of a driver over a telescope."""


@contextmanager
def mount_rig(seed: int, driver: str, rendered: bool = False, far_end: FarEnd = open_responder) -> Iterator[MountRig]:
    """A misaligned, flexing mount that points 3 deg from where it believes, and a target for it.

    Parameters
    ----------
    seed : int
        Draws the night.
    driver : str
        Name of the mount's driver.
    rendered : bool
        Whether frames are rendered; else star lists are made.
    far_end : FarEnd
        Makes the simulated device behind the line.
    """
    site = SITES[seed // 2 % 2]
    rng = np.random.default_rng([seed, 77])
    side = 1.0 if seed % 2 else -1.0  # start and target are on one side of the meridian
    night = practice_night(misaligned(tonight(seed, site, DATE_UNIX), None, LOST_DEG), faults=False)
    hour, dec = random_place(rng, site.latitude_deg, (12.0, 60.0), 30.0, 0.95)
    night = replace(night, rate=1.0, start_deg=(side * hour, dec))
    rig = PracticeRig(night, mount_class=WatchedMount)
    rig.clock.most_s = STALL_S
    watched, faults = rig.mount, Faults(seed, late_s=LATE_S)
    assert isinstance(watched, WatchedMount)
    serve = socket_line if sys.platform == "win32" else pty_line
    line = serve(far_end(driver, rig.mount), faults)

    def opened(stop_first: bool = False) -> Any:
        mount: Any = open_mount(
            driver,
            line.port,
            site=site,
            clock=rig.clock.now_utc,
            stop_first=stop_first,
            home=Home.POWER_ON,  # the board counts from where the mount's computer believes home to be
        )
        mount.timeout_s = PATIENCE_S
        return mount

    with ExitStack() as at_the_end:
        at_the_end.callback(line.stop)
        mount = opened()
        watched.orders.clear()
        guard = Guard(
            mount,
            site,
            Limits(),
            clock=rig.clock.now_utc,
            reopen=lambda: opened(stop_first=True),
            wait=lambda s: bench.wait(s),
        )
        at_the_end.callback(guard.close)
        at_the_end.callback(faults.none)  # before the guard stops the mount
        hour, dec = random_place(rng, site.latitude_deg, (12.0, 60.0), 30.0, 0.95)
        date = Pointing((rig.mount.sidereal_deg() - side * hour) % 360.0, dec, Epoch.DATE)
        target = target_at(*from_mount_epoch(date, rig.clock.now_utc()))
        bench = MountRig(rig, line, faults, guard, watched, target, rendered)
        yield bench
