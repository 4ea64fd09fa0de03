"""One practice telescope behind a real line, for runs by the hundred: time jumps where it may.

The mount's clock runs as fast as the wall's while bytes are under way or a motion is timed by this
computer; all other waiting, and exposures, are jumps. A line that is silent is given up after
half a second instead of five.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.bench.mount_watch import Watched
from app.core.hint import Site
from app.core.mount import Epoch, Mount, Pointing
from app.core.progress import Task
from app.core.solution import NoSolution, Solution
from app.mounts import open_mount
from app.mounts.epoch import from_mount_epoch
from app.mounts.guard import Guard
from app.mounts.limits import Limits
from app.simulate.line import Line, pty_line, socket_line
from app.simulate.line_faults import Fault, Faults
from app.simulate.practice import responder_on
from app.simulate.rig import PracticeRig
from app.simulate.scenario import misaligned, practice_night, tonight
from app.sky.catalogue import Catalogue
from app.solve.options import SolveOptions
from app.solve.solver import solve_detections, solve_frame
from app.workflows.goto_target import Target, target_at

SITES = (Site(47.0, 8.0, 450.0), Site(-33.0, 151.0, 60.0))
DATE_UNIX = 1_800_000_000.0
LOST_DEG = 3.0
EXPOSURE_S = 2.0
PATIENCE_S, LATE_S = 0.5, 0.7
HEARD_S = 0.05
UNANSWERED = ("pulse", "move", "stop")
CHANCES = {
    Fault.SILENCE: 0.01,
    Fault.GARBAGE: 0.01,
    Fault.LATE: 0.01,
    Fault.SPLIT: 0.03,
    Fault.WRONG: 0.01,
}


@dataclass(slots=True)
class MountRig:
    """A rig, the line to its mount, and the guard around the driver at the other end."""

    rig: PracticeRig
    line: Line
    faults: Faults
    guard: Guard
    watched: Watched
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
        deadman = getattr(self.guard.mount, "deadman", None)
        if deadman is not None and deadman.moving:
            self.timed = True
            time.sleep(seconds)
            return
        last = self.guard.log.entries[-1:]
        if self.timed or any(entry.action in UNANSWERED for entry in last):
            time.sleep(HEARD_S)  # the bytes that begin or end a motion may still be under way
            self.timed = False
        self.rig.clock.step(seconds)

    def solve_now(self) -> Task[Solution | NoSolution]:
        """A fresh frame, or for most runs the list of stars that its detector would give."""
        clock = self.rig.clock
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


@contextmanager
def mount_rig(
    seed: int, driver: str, catalogue: Catalogue, rendered: bool = False
) -> Iterator[MountRig]:
    """A worn, misaligned mount that points 3 deg beside where it believes, and a target for it."""
    site = SITES[seed // 2 % 2]
    rng = np.random.default_rng([seed, 77])
    side = 1.0 if seed % 2 else -1.0
    night = practice_night(misaligned(tonight(seed, site, DATE_UNIX), None, LOST_DEG), faults=False)
    rig = PracticeRig(replace(night, rate=1.0, start_deg=_place(rng, side, site)), catalogue)
    watched, faults = Watched(rig.mount), Faults(seed, late_s=LATE_S)
    serve = socket_line if sys.platform == "win32" else pty_line
    line = serve(responder_on(driver, rig, watched), faults)
    guard: Guard | None = None
    try:

        def opened(stop_first: bool = False) -> Mount:
            return _opened(driver, line.port, rig, site, stop_first)

        mount = opened()
        watched.orders.clear()
        guard = Guard(
            mount, site, Limits(), clock=rig.clock.now_utc,
            reopen=lambda: opened(stop_first=True), wait=lambda s: bench.wait(s),
        )  # fmt: skip
        hour, dec = _place(rng, side, site)
        date = Pointing((rig.mount.sidereal_deg() - hour) % 360.0, dec, Epoch.DATE)
        target = target_at(*from_mount_epoch(date, rig.clock.now_utc()))
        bench = MountRig(rig, line, faults, guard, watched, target, rendered)
        yield bench
    finally:
        faults.none()
        if guard is not None:
            guard.close()
        line.stop()


def _opened(driver: str, port: str, rig: PracticeRig, site: Site, stop_first: bool) -> Mount:
    mount: Any = open_mount(driver, port, site=site, clock=rig.clock.now_utc, stop_first=stop_first)
    mount.timeout_s = PATIENCE_S
    opened: Mount = mount
    return opened


def _place(rng: np.random.Generator, side: float, site: Site) -> tuple[float, float]:
    """Hour angle and declination on one side of the meridian, 30 deg above the ground at least."""
    latitude = np.radians(site.latitude_deg)
    while True:
        hour, dec = side * rng.uniform(12.0, 60.0), np.degrees(np.arcsin(rng.uniform(-0.95, 0.95)))
        height = np.sin(latitude) * np.sin(np.radians(dec)) + np.cos(latitude) * np.cos(
            np.radians(dec)
        ) * np.cos(np.radians(hour))
        if height > 0.5:
            return float(hour), float(dec)
