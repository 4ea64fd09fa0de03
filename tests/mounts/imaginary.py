"""A mount in memory for the guard's own tests: it does at once what it is told, and remembers."""

from datetime import UTC, datetime

from app.core.errors import NoAnswerError
from app.core.hint import Site
from app.core.mount import Epoch, MountState, Pointing
from app.mounts.guard import Guard
from app.mounts.limits import Limits
from app.mounts.sky_frame import sidereal_deg

SITE = Site(50.0, 8.0)
NIGHT = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)
NOON = datetime(2026, 6, 21, 11, 30, tzinfo=UTC)


class Imaginary:
    name = "imaginary"
    epoch = Epoch.DATE

    def __init__(self, ra_deg=0.0, dec_deg=0.0):
        self.here = (ra_deg, dec_deg)
        self.now = MountState(slewing=False, parked=False, aligned=True, tracking=True)
        self.did = []
        self.lacks = {}
        self.takes_syncs = True
        self.fails = {}

    def _do(self, name, *args):
        self.did.append((name, *args))
        if name in self.fails:
            raise self.fails[name]

    def identify(self):
        return "imaginary mount"

    def position(self):
        return Pointing(*self.here, self.epoch)

    def state(self):
        return self.now

    def sync(self, ra_deg, dec_deg):
        self._do("sync", ra_deg, dec_deg)
        if self.takes_syncs:
            self.here = (ra_deg, dec_deg)

    def goto(self, ra_deg, dec_deg):
        self._do("goto", ra_deg, dec_deg)
        self.here = (ra_deg, dec_deg)

    def stop(self):
        self._do("stop")

    def pulse(self, direction, milliseconds):
        self._do("pulse", direction, milliseconds)

    def move(self, direction, rate_deg_s, seconds):
        self._do("move", direction, rate_deg_s, seconds)

    def track(self, on):
        self._do("track", on)

    def close(self):
        self.did.append(("close",))


def at(hour_angle_deg, dec_deg, time_utc=NIGHT):
    """RA and Dec of date at an hour angle."""
    return (sidereal_deg(SITE, time_utc) - hour_angle_deg) % 360.0, dec_deg


def guarded(hour_angle_deg=-40.0, dec_deg=40.0, time_utc=NIGHT, site=SITE, **limits):
    """A guard around an imaginary mount that points at this hour angle and declination."""
    mount = Imaginary(*at(hour_angle_deg, dec_deg, time_utc))
    guard = Guard(mount, site, Limits(**limits), clock=lambda: time_utc, wait=lambda s: None)
    return guard, mount


SILENT = NoAnswerError("The mount does not answer.")
