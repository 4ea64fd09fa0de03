"""A mount in memory for the guard's own tests: it does at once what it is told, and remembers."""

import time
from dataclasses import replace
from datetime import UTC, datetime
from math import inf

from kochab.core.attitude import apart_deg
from kochab.core.errors import LineLostError, NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Epoch, MountState, Pointing, SiteReport, TrackingRate
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.sky.horizon import sidereal_deg

SITE = Site(50.0, 8.0)
NIGHT = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)
NOON = datetime(2026, 6, 21, 11, 30, tzinfo=UTC)


class Imaginary:
    """At once where it is sent; with a speed it takes its time, as the conformance suite wants it."""

    name = "imaginary"
    epoch = Epoch.DATE
    blind_stop = b""
    ends_alone = True
    rates_deg_s = ()
    lag_s = 0.0
    missed = 0

    def __init__(self, ra_deg=0.0, dec_deg=0.0, slew_deg_s=inf):
        self.here = (ra_deg, dec_deg)
        self.now = MountState(slewing=False, parked=False, aligned=True, tracking=True)
        self.did = []
        self.lacks = dict.fromkeys((Ability.SITE, Ability.TIME), "It is imaginary.")
        self.takes_syncs = True
        self.fails = {}
        self.slew_deg_s = slew_deg_s
        self.closed = False
        self._way = None  # from, to, seconds, begun

    def _do(self, name, *args):
        self.did.append((name, *args))
        if name in self.fails:
            raise self.fails[name]

    def _begin(self, ra_deg, dec_deg, seconds):
        self._advance()
        self._way = (self.here, (ra_deg, dec_deg), seconds, time.monotonic())
        self._advance()

    def _advance(self):
        if self._way is None:
            return
        start, end, seconds, begun = self._way
        share = min(1.0, (time.monotonic() - begun) / seconds) if seconds else 1.0
        if share == 1.0:
            self.here, self._way = end, None
        else:
            self.here = tuple(a + share * (b - a) for a, b in zip(start, end, strict=True))

    @property
    def moving(self):
        self._advance()
        return self._way is not None

    @property
    def watchdog(self):
        return self

    def identify(self):
        return "imaginary mount"

    def altaz_deg(self):
        return None

    def site_report(self):
        return SiteReport()

    def position(self):
        if self.closed:
            raise LineLostError("The line is closed.")
        self._advance()
        return Pointing(*self.here, self.epoch)

    def state(self):
        return replace(self.now, slewing=True, parked=False, at_home=False) if self.moving else self.now

    def sync(self, ra_deg, dec_deg):
        self._do("sync", ra_deg, dec_deg)
        if self.takes_syncs:
            self.here = (ra_deg, dec_deg)

    def goto(self, ra_deg, dec_deg):
        self._do("goto", ra_deg, dec_deg)
        self._begin(ra_deg, dec_deg, apart_deg(self.here, (ra_deg, dec_deg)) / self.slew_deg_s)

    def stop(self):
        self._do("stop")
        self._advance()
        self._way = None

    def pulse(self, direction, milliseconds):
        self._do("pulse", direction, milliseconds)
        self._turn(direction, 7.5 / 3600.0 * milliseconds / 1000.0, 0.0)

    def move(self, direction, rate_deg_s, seconds):
        self._do("move", direction, rate_deg_s, seconds)
        self._turn(direction, rate_deg_s * seconds, 0.0 if self.slew_deg_s == inf else seconds)

    def _turn(self, direction, angle_deg, seconds):
        east, north = {"east": (1, 0), "west": (-1, 0), "north": (0, 1), "south": (0, -1)}[direction]
        ra, dec = self.here
        self._begin((ra + east * angle_deg) % 360.0, dec + north * angle_deg, seconds)

    def track(self, rate):
        self._do("track", rate)
        self.now = replace(self.now, tracking=rate is not TrackingRate.OFF, rate=rate)

    def _rest(self, name, here, **state):
        self._do(name)
        self._begin(*here, apart_deg(self.here, here) / self.slew_deg_s)
        self.now = replace(self.now, tracking=False, **state)

    def park(self):
        self._rest("park", (self.here[0], min(90.0, self.here[1] + 3.0)), parked=True)

    def park_altitude_deg(self):
        return None

    def unpark(self):
        self._do("unpark")
        self.now = replace(self.now, parked=False)

    def go_home(self):
        self._rest("home", (self.here[0], 90.0), at_home=True)

    def close(self):
        self.did.append(("close",))
        self._advance()
        self._way, self.closed = None, True


def at(hour_angle_deg, dec_deg, time_utc=NIGHT):
    """RA and Dec of date at an hour angle."""
    return (sidereal_deg(SITE, time_utc) - hour_angle_deg) % 360.0, dec_deg


def guarded(hour_angle_deg=-40.0, dec_deg=40.0, time_utc=NIGHT, site=SITE, **limits):
    """A guard around an imaginary mount that points at this hour angle and declination."""
    mount = Imaginary(*at(hour_angle_deg, dec_deg, time_utc))
    guard = Guard(mount, site, Limits(**limits), clock=lambda: time_utc, wait=lambda s: None)
    return guard, mount


SILENT = NoAnswerError("The mount does not answer.")
