"""Clock, site and power flag are asked for again after every silence and reconnection, family by family.

Each test changes one of them at the far end, by less than would contradict the computer, and lets one answer be missed:
a driver that does not ask that question, or a guard that does not ask again, slews on.
"""

from datetime import timedelta

import pytest

from kochab.core.frame import Site
from kochab.gear.mounts import DRIVERS, SERVERS, open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from tests.boards import served, virtual_time

from .bench import COUNTERS, LIMITS, SITE, alpaca, place, simulated

ASK = [name for name in DRIVERS if name not in (*SERVERS, *COUNTERS, "rainbow")]
"""Those whose mounts tell their clock and site: a motor board and a Rainbow have neither, and INDI's server tells of
news by itself."""
SILENCE, RECONNECTION = "a missed answer", "a reconnection"
HOW = pytest.mark.parametrize("how", [SILENCE, RECONNECTION])


def compared(guard, target, change, how):
    """Whether it slews after it was asked once, after a change that nobody need see, and after a silence."""
    assert guard.preview_goto(*target).allowed
    change()
    assert guard.preview_goto(*target).allowed, "it answers everything: it is not asked again"
    if how is SILENCE:
        guard.mount.talk.missed += 1
    else:
        guard.reconnect()
    preview = guard.preview_goto(*target)
    assert preview.allowed is not ("Mount was restarted" in " ".join(preview.refusals))
    return preview.allowed


@pytest.fixture(params=ASK)
def simulator(request):
    with simulated(request.param) as bench:
        bench.driver = request.param
        with Guard(bench.open(), SITE, LIMITS, clock=bench.clock, reopen=bench.open) as guard:
            yield bench, guard


@HOW
@pytest.mark.parametrize("what", ["nothing", "clock", "site"])
def test_a_clock_or_a_site_that_changed_in_a_silence_forbids_slews(what, how, simulator) -> None:
    bench, guard = simulator
    guard.site = None  # else the site's own contradiction would do

    def change():
        if what == "clock":
            bench.settings.clock_error -= timedelta(seconds=75.0)
        elif what == "site":
            bench.settings.latitude_deg -= 2.0

    guard.limits = Limits(crosses_meridian=True, allow_without_site=True)
    allowed = compared(guard, place(-30.0, 50.0, bench.clock), change, how)
    assert allowed is (what == "nothing")


@HOW
@pytest.mark.parametrize(
    ("kind", "flag", "woken"),
    [("am5", "reset_reason", 1), ("onstep", "clock_set", False), ("onstepx", "clock_set", False)],
)
def test_a_power_flag_that_changed_in_a_silence_forbids_slews(kind, flag, woken, how) -> None:
    """``:GRR#`` of an AM5 and ``:GX89#`` of an OnStep, on a board whose clock and site are as before."""
    with virtual_time() as time, served(kind, time=time) as board:
        board.align(-50.0, 40.0)
        board.reset_reason = 0  # as after a start by its reset button

        def opened():
            return open_mount(board.driver, board.port, site=board.site, clock=board.clock)

        with Guard(opened(), board.site, Limits(crosses_meridian=True), clock=board.clock, reopen=opened) as guard:
            target = (board.radec_deg()[0] + 10.0) % 360.0, 45.0
            assert not compared(guard, target, lambda: setattr(board, flag, woken), how)


@HOW
@pytest.mark.parametrize("what", ["nothing", "clock", "site"])
def test_the_same_behind_an_alpaca_server(what, how, tmp_path) -> None:
    with alpaca(tmp_path) as bench:
        device = bench.device
        error, there = timedelta(), SITE
        device.get_utcdate = lambda: f"{bench.clock() + error:%Y-%m-%dT%H:%M:%S}Z"
        device.get_sitelatitude = lambda: there.latitude_deg

        def change():
            nonlocal error, there
            if what == "clock":
                error = timedelta(seconds=-75.0)
            elif what == "site":
                there = Site(SITE.latitude_deg - 2.0, SITE.longitude_deg)

        limits = Limits(crosses_meridian=True, allow_without_site=True)
        with Guard(bench.open(), None, limits, clock=bench.clock, reopen=bench.open) as guard:
            target = place(-30.0, 50.0, bench.clock)
            assert guard.preview_goto(*target).allowed
            change()
            if how is SILENCE:
                guard.mount.missed += 1
            else:
                guard.reconnect()
            assert guard.preview_goto(*target).allowed is (what == "nothing")
