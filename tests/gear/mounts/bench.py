"""Simulated mounts on real pseudo-terminals, one for every driver, and a guard around each."""

from contextlib import contextmanager
from datetime import UTC, datetime
from types import SimpleNamespace

from kochab.core.frame import Site
from kochab.core.mount import Home
from kochab.gear.mounts import COUNT_STEPS, open_mount
from kochab.gear.mounts.motion_plan import Limits
from kochab.simulate.serial_line import Faults, own_line
from kochab.sky.horizon import sidereal_deg
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.dialects import open_any

from .alpaca_telescope import AlpacaTelescope, alpaca_server
from .indi_server import indi_server

SITE = Site(50.0, 8.0)
START = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)  # the Sun is far below the horizon
COUNTERS = COUNT_STEPS  # what they point at only the driver knows
LIMITS = Limits(crosses_meridian=True, read_back_arcsec=120.0)


class Night:
    """A clock that begins at night and runs with the computer's."""

    def __init__(self):
        self._shift = START - datetime.now(UTC)

    def __call__(self):
        return datetime.now(UTC) + self._shift

    def unix(self):
        return self().timestamp()


def place(hour_angle_deg, dec_deg, clock):
    """RA and Dec of date at an hour angle now."""
    return (sidereal_deg(SITE, clock()) - hour_angle_deg) % 360.0, dec_deg


@contextmanager
def simulated(driver, slew_deg_s=20.0, aligned=True):
    """A telescope at hour angle -20 deg, Dec 40 deg, on a pseudo-terminal."""
    clock = Night()
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, slew_deg_s, clock.unix)
    telescope.aligned = aligned
    faults = Faults(late_s=0.5)
    responder = open_any(driver, telescope)
    line = own_line(responder, faults)
    start = place(-20.0, 40.0, clock)
    telescope.sync(*start)
    telescope.log.clear()
    try:
        yield SimpleNamespace(
            telescope=telescope,
            line=line,
            far_end=responder,
            settings=None if driver in COUNTERS else responder.settings,
            faults=faults,
            clock=clock,
            port=line.port,
            start=start,
            open=lambda: opened(driver, line.port, clock),
        )
    finally:
        line.stop()


@contextmanager
def indi(home):
    """The same mount, reached through INDI's own iOptron driver."""
    with simulated("ioptron") as bench, indi_server(home, "indi_ioptronv3_telescope") as server:
        device = "iOptronV3"
        bench.address = f"{server.address}/{device}"
        server.set(f"{device}.DEVICE_AUTO_SEARCH.INDI_DISABLED=On", f"{device}.DEVICE_PORT.PORT={bench.port}")
        bench.open = lambda: opened("indi", f"{server.address}/{device}", bench.clock)
        yield bench


@contextmanager
def alpaca(home):
    """A telescope behind an Alpaca server written from ASCOM's reference."""
    clock = Night()
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 20.0, clock.unix)
    start = place(-20.0, 40.0, clock)
    telescope.sync(*start)
    telescope.log.clear()
    device = AlpacaTelescope(telescope)
    with alpaca_server(device) as server:
        port = f"127.0.0.1:{server.port}/0"
        line = SimpleNamespace(transcript=[])
        found = SimpleNamespace(telescope=telescope, line=line, clock=clock, port=port, start=start, device=device)
        found.open = lambda: opened("alpaca", port, clock)
        yield found


def opened(driver, port, clock):
    """The driver on a port; a motor board is told where it points, as after every start."""
    mount = open_mount(driver, port, site=SITE, clock=clock, home=Home.NOW)
    if driver in COUNTERS:
        mount.sync(*place(-20.0, 40.0, clock))
    return mount


def where(bench):
    """Where the mount should say it points before anything moved: a motor board does not track."""
    return place(-20.0, 40.0, bench.clock) if bench.driver in COUNTERS else bench.start


def moved(telescope):
    """Every order the telescope got that moves something, in order."""
    motions = ("goto", "move", "pulse", "turn", "turn to")
    return [entry for entry in telescope.log if entry[0] in motions and entry[-1] != 0.0]


def still(telescope):
    """Whether nothing moves but with the sky."""
    return not telescope.slewing and telescope._rates[1] == 0.0 and _ra_rate_is_the_skys(telescope)


def _ra_rate_is_the_skys(telescope):
    return abs(telescope._rates[0]) < 0.006  # a motor board tracks by a bare rate


__all__ = [
    "COUNTERS",
    "LIMITS",
    "SITE",
    "START",
    "Night",
    "alpaca",
    "indi",
    "moved",
    "opened",
    "place",
    "simulated",
    "still",
    "where",
]
