"""The practice rig's mount as a driver, without a line between: for closed loops in memory."""

from datetime import UTC, datetime

from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.mount import Direction, Epoch, MountState, Pointing, SiteReport
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.simulate.rig import PracticeRig
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections
from tests.simulate.rig_help import catalogue


class RigMount:
    """A :class:`~kochab.core.mount.Mount` over a rig whose clock stands still but for waits."""

    name = "rig"
    epoch = Epoch.DATE
    blind_stop = b""
    ends_alone = True
    missed = 0
    lag_s = 0.0
    rates_deg_s = (15.0 / 3600.0, 120.0 / 3600.0, 1.0)

    def __init__(self, rig):
        self.rig = rig
        self.lacks = {}
        self.did = []
        self.takes_syncs = True
        self.fails = {}  # order -> errors still to come
        self._ends = None

    def _do(self, name, *args):
        self.did.append((name, *args))
        if self.fails.get(name):
            raise self.fails[name].pop(0)

    def identify(self):
        return "rig"

    def altaz_deg(self):
        return None

    def site_report(self):
        return SiteReport()

    def position(self):
        self._end_moves()
        return Pointing(*self.rig.mount.believed_deg(), self.epoch)

    def state(self):
        m = self.rig.mount
        return MountState(m.slewing, m.parked, m.aligned, m.tracking, m.pier_side)

    def sync(self, ra_deg, dec_deg):
        self._do("sync", ra_deg, dec_deg)
        if self.takes_syncs:
            self.rig.mount.sync(ra_deg, dec_deg)

    def goto(self, ra_deg, dec_deg):
        self._do("goto", ra_deg, dec_deg)
        reason = self.rig.mount.goto(ra_deg, dec_deg)
        if reason:
            raise RefusedError(f"The mount refuses to go there: {reason}.")

    def stop(self):
        self._do("stop")
        self.rig.mount.stop()

    def pulse(self, direction: Direction, milliseconds: int):
        self._do("pulse", direction, milliseconds)
        self.rig.mount.pulse(direction, milliseconds)

    def move(self, direction, rate_deg_s, seconds):
        self._do("move", direction, rate_deg_s, seconds)
        self.rig.mount.move(direction, rate_deg_s)
        self._ends = (self.rig.clock.now_unix() + seconds, direction)

    def wait(self, seconds):
        """Let simulated time pass; a move ends when its time is over."""
        end = self.rig.clock.now_unix() + seconds
        if self._ends is not None and self._ends[0] <= end:
            self.rig.clock.step(max(0.0, self._ends[0] - self.rig.clock.now_unix()))
            self._end_moves()
        self.rig.clock.step(max(0.0, end - self.rig.clock.now_unix()))

    def _end_moves(self):
        if self._ends is not None and self._ends[0] <= self.rig.clock.now_unix() + 1e-6:
            self.rig.mount.halt(self._ends[1])
            self._ends = None

    def track(self, rate):
        self._do("track", rate)
        self.rig.mount.tracking_deg_s = rate.deg_s

    def park(self):
        self._do("park")
        self.rig.mount.park()

    def park_altitude_deg(self):
        return None

    def unpark(self):
        self._do("unpark")
        self.rig.mount.parked = False

    def go_home(self):
        self._do("home")
        self.rig.mount.go_home()

    def close(self):
        self.did.append(("close",))


class Bench:
    """A rig, its guarded mount, and what solves what it sees now."""

    def __init__(self, config, **limits):
        self.rig = PracticeRig(config, catalogue())
        self.mount = RigMount(self.rig)
        self.guard = Guard(
            self.mount, config.site, Limits(**limits), clock=self.rig.clock.now_utc, wait=self.mount.wait
        )
        self.wait = self.mount.wait
        self.solves = 0
        self.exposed_utc = None

    def solve_now(self, exposure_s=2.0):
        self.solves += 1
        stars, hint = self.rig.star_list(exposure_s)
        self.exposed_utc = hint.time_utc
        return (yield from solve_detections(stars, SolveOptions(hint=hint)))

    def taken(self):
        """When the last frame was exposed."""
        return self.exposed_utc

    def place(self, hour_deg, dec_deg):
        """ICRS degrees of an hour angle and a declination of date, now."""
        from kochab.gear.mounts.coordinates import from_mount_epoch

        ra = (self.rig.mount.sidereal_deg() - hour_deg) % 360.0
        now = self.rig.clock.now_utc()
        return from_mount_epoch(Pointing(ra, dec_deg, Epoch.DATE), now)

    def off_arcsec(self, target):
        """From where the rig really points to a target in ICRS."""
        from kochab.core.attitude import apart_deg

        return apart_deg(self.rig.truth().ra_dec_deg, (target.ra_deg, target.dec_deg)) * 3600.0


SILENT = NoAnswerError("The mount does not answer.")
NIGHT = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)
