"""Mounts that Kochab drives through INDI's drivers alone: its guard, Debian's driver, and boards that nobody here drives."""

import platform
import threading
import time
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from math import inf

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, RefusedError, StrayedError
from kochab.core.mount import Ability, Direction, Epoch, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.workflows.nudge import nudge
from tests.boards import BEHIND_INDI, SITE
from tests.boards.exos2 import GOTO
from tests.boards.indi import PROGRAMS, behind_indi
from tests.boards.sky import Night, sidereal_deg

pytest.importorskip("indipyclient")
# Near 60 deg of declination the Sun never comes; elsewhere its hour decides, which these tests are not about.
LIMITS = Limits(crosses_meridian=True, sun_up_deg=90.0)
ROUNDED_DEG = {"starbook": 4.0 / 60.0}


@contextmanager
def at_the_telescope(kind, home, connects=False, **settings):
    """A board behind INDI's driver, and Kochab's guard of it; Kochab has the driver connect."""
    settings.setdefault("slew_deg_s", 10.0)
    with behind_indi(kind, home, connects, **settings) as (board, indi):
        indi.tell(board)

        def reopened():
            indi.tell(board)  # INDI's StarBook driver ends at a time-out, and another is started that knows nothing
            return opened(board, indi)

        with Guard(opened(board, indi), SITE, LIMITS, clock=board.clock, reopen=reopened) as guard:
            yield board, guard, indi


def opened(board, indi):
    return open_mount("indi", f"localhost:7624/{indi.device}", site=SITE, clock=board.clock)


def place(board, hour_angle_deg, dec_deg):
    return (sidereal_deg(board.clock.unix(), SITE.longitude_deg) - hour_angle_deg) % 360.0, dec_deg


def near_deg(board):
    return ROUNDED_DEG.get(board.kind, 25.0 / 3600.0)


def said(order):
    """What an order that has to fail says."""
    with pytest.raises(DeviceError) as told:
        order()
    return str(told.value)


def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


@pytest.fixture(params=BEHIND_INDI)
def kind(request):
    return request.param


def test_kochab_connects_reads_goes_syncs_and_stops(kind, tmp_path):
    with at_the_telescope(kind, tmp_path) as (board, guard, indi):
        here = guard.position()
        assert here.epoch is Epoch.DATE
        assert apart_deg((here.ra_deg, here.dec_deg), board.radec_deg()) < near_deg(board)
        assert (guard.state().slewing, guard.state().parked) == (False, False)
        target = place(board, -30.0, 60.0)
        run(guard.slew(*target))
        assert not board.moving
        assert apart_deg(board.radec_deg(), target) < near_deg(board)
        axes = [axis.at_deg for axis in board.tube.axes]
        board.set_counters((axes[0], axes[1] - board.zero_deg[1] + 1.0))  # a clutch slipped
        indi.says(board.believed_deg())
        guard.sync(*board.radec_deg(), by_hand=True, confirmed=True)
        assert board.false_by_deg() < near_deg(board)
        guard.goto(*place(board, -30.0, 85.0))
        wait_for(lambda: board.moving)
        guard.stop()
        guard.emergency.confirm()
        wait_for(lambda: not board.moving)
        assert board.radec_deg()[1] < 84.0


def test_a_slew_in_declination_alone_ends_where_it_was_sent(kind, tmp_path):
    """INDI's EXOS-2 driver calls it over at once: it compares right ascensions alone."""
    with at_the_telescope(kind, tmp_path, slew_deg_s=3.0) as (board, guard, _):
        target = board.radec_deg()[0], 85.0
        run(guard.slew(*target))
        assert not board.moving
        assert apart_deg(board.radec_deg(), target) < near_deg(board)


def test_kochab_parks_and_unparks_and_goes_on(kind, tmp_path):
    with at_the_telescope(kind, tmp_path) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        run(guard.rest("park"))
        assert not board.moving
        assert (guard.state().parked, guard.state().slewing) == (True, False)
        wanted = (90.0, 0.0) if kind == "starbook" else (90.0, 90.0)
        assert board.believed_axes_deg() == pytest.approx(wanted)
        assert "parked" in said(lambda: guard.goto(*place(board, -30.0, 60.0)))
        guard.unpark()
        target = place(board, -50.0, 60.0)
        run(guard.slew(*target))
        assert apart_deg(board.radec_deg(), target) < near_deg(board)


def in_spite_of_lines(guard, order):
    """What an order says that has to fail; a line that was lost is opened again, as the window does."""
    try:
        order()
    except LineLostError as error:
        end = time.monotonic() + 90.0
        while True:
            try:
                guard.reconnect()
                return str(error)
            except DeviceError:
                if time.monotonic() > end:  # nor does its power
                    return str(error)
                time.sleep(0.5)
    except DeviceError as error:
        return str(error)
    pytest.fail("it went there")


TELL_OF_SILENCE = pytest.mark.parametrize("kind", ["stargo", "starbook"])
"""INDI's EXOS-2 driver does not: it repeats the last place of a mount that fell silent."""


@pytest.mark.parametrize("looks", [0, 20], ids=["ordered at once", "looked at meanwhile"])
def test_a_mount_that_lost_its_power_is_not_slewed_from_where_it_woke_up(kind, looks, tmp_path):
    """The port stays open, and somebody presses OK on the StarBook's screen as soon as it shows.

    INDI's StarGo driver sends the goto on when the mount wakes up, and Kochab stops it there.
    """
    settings = {"starts": True} if kind == "starbook" else {}
    with at_the_telescope(kind, tmp_path, slew_deg_s=4.0, **settings) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        stood = board.tube.hour_angle_dec_deg()
        board.cut_power(1.0)
        for _ in range(looks):
            with suppress(DeviceError):
                guard.state()
                guard.position()
            time.sleep(0.5)
        told = [in_spite_of_lines(guard, lambda: run(guard.slew(*place(board, -60.0, 45.0)))) for _ in range(4)]
        wait_for(lambda: not board.moving)
        assert "Sync first" in told[-1]
        assert apart_deg(stood, board.tube.hour_angle_dec_deg()) < (3.0 if kind == "stargo" else 0.1)
        assert len(board.false_slews()) <= (kind == "stargo" and not looks)
        if kind == "starbook":
            board.clock_error_s = 240.0 * 40.0  # by its clock the place is in the west, where it woke up
            guard.allow_large_sync = True
            guard.sync(*board.radec_deg(), by_hand=True, confirmed=True)
            target = place(board, -30.0, 60.0)
            run(guard.slew(*target))
            assert apart_deg(board.radec_deg(), target) < near_deg(board)
            board.clock_error_s = 0.0  # the side of the pier, which no sync tells, is wrong: it sets out for the other
            with pytest.raises(StrayedError, match="the wrong way"):
                run(guard.slew(*place(board, -30.0, 60.0)))


def test_a_place_that_indis_exos2_driver_withheld_is_no_word_of_a_mount_that_woke_up(tmp_path):
    """It tells the last report of before the cut when it sends a Stop: that passed for the mount's own answer."""
    with at_the_telescope("exos2", tmp_path, slew_deg_s=6.0) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        guard.stop()
        guard.emergency.confirm()
        board.cut_power(0.1)
        time.sleep(board.boot_s + 1.0)
        orders = len(board.orders)
        told = in_spite_of_lines(guard, lambda: run(guard.slew(*place(board, -60.0, 45.0))))
        assert "switched off and on" in told
        assert [order.kind for order in board.orders[orders:] if order.kind == "goto"] == []


def test_power_lost_during_a_slew_is_told_and_nothing_slews_on(kind, tmp_path):
    settings = {"starts": True} if kind == "starbook" else {}
    with at_the_telescope(kind, tmp_path, slew_deg_s=3.0, **settings) as (board, guard, _):

        def cut():
            wait_for(lambda: board.moving)
            time.sleep(2.0)
            board.cut_power(0.5)

        thread = threading.Thread(target=cut)
        thread.start()
        in_spite_of_lines(guard, lambda: run(guard.slew(*place(board, -30.0, 80.0))))
        thread.join()
        wait_for(lambda: board.powered)
        stood = board.tube.hour_angle_dec_deg()
        told = [in_spite_of_lines(guard, lambda: run(guard.slew(*place(board, -60.0, 45.0)))) for _ in range(4)]
        assert "Sync first" in told[-1]
        assert apart_deg(stood, board.tube.hour_angle_dec_deg()) < 1.0


@TELL_OF_SILENCE
def test_a_mount_without_power_is_told_and_a_driver_that_gives_it_up_too(kind, tmp_path):
    with at_the_telescope(kind, tmp_path) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        board.cut_power(3600.0)
        told = {type(error) for error in looks(guard, 25)}
        assert told
        assert told <= {NoAnswerError, LineLostError}
        orders = len(board.orders)
        in_spite_of_lines(guard, lambda: run(guard.slew(*place(board, -50.0, 60.0))))
        assert len(board.orders) == orders
        board.cut_power(0.0)
        wait_for(lambda: board.powered)
        in_spite_of_lines(guard, lambda: run(guard.slew(*place(board, -60.0, 45.0))))


def looks(guard, count):
    errors = []
    for _ in range(count):
        try:
            guard.position()
        except DeviceError as error:
            errors.append(error)
        time.sleep(0.5)
    return errors


def test_what_a_driver_lacks_is_said_before_it_is_asked_for(kind, tmp_path):
    day = {"clock": Night(datetime(2027, 1, 28, 21, tzinfo=UTC))} if kind == "exos2" else {}
    with at_the_telescope(kind, tmp_path, **day) as (board, guard, _):
        lacks = set(guard.lacks)
        assert Ability.HOME in lacks
        assert not {Ability.GOTO, Ability.SYNC, Ability.STOP, Ability.PARK, Ability.MOVE} & lacks
        assert (Ability.PULSE in lacks) is (kind == "starbook")
        assert (Ability.SET_CLOCK in lacks) is (kind == "stargo")
        assert (Ability.TRACKING in lacks) is (kind != "stargo")
        if kind == "stargo":
            site = guard.site_report().site
            assert (site.latitude_deg, site.longitude_deg) == (SITE.latitude_deg, SITE.longitude_deg)
            for rate in (TrackingRate.OFF, TrackingRate.SIDEREAL):
                guard.track(rate)
                assert board.tracking is guard.state().tracking is (rate is TrackingRate.SIDEREAL)
        if kind == "starbook":  # which takes neither while it is aligned
            assert "refuses the time" in said(guard.set_clock)
            assert "refuses the site" in said(guard.set_site)
        if kind == "exos2":
            guard.set_clock()
            assert abs(board.clock_error_s) < 5.0
            # In years that are no leap years INDI's driver takes every month for February.
            assert "refuses the time" in said(lambda: guard.set_clock(datetime(2027, 1, 29, 21, tzinfo=UTC)))


def test_a_move_goes_where_it_says_and_ends(kind, tmp_path):
    with at_the_telescope(kind, tmp_path) as (board, guard, _):
        wait_for(lambda: guard.state().slewing is False)
        guard.position()
        for direction, axis, sense in ((Direction.NORTH, 1, 1.0), (Direction.EAST, 0, 1.0)):
            begun = board.radec_deg()
            ordered_s = moves_when_it_tracks(guard, direction)
            wait_for(lambda: not guard.mount.watchdog.moving and not board.moving)
            moved = [(now - then + 180.0) % 360.0 - 180.0 for now, then in zip(board.radec_deg(), begun, strict=True)]
            # A busy machine ends it late: a second of it is held to the same 8 degrees.
            assert 0.01 < sense * moved[axis] < 8.0 * (time.monotonic() - ordered_s)
            assert abs(moved[1 - axis]) < 0.05


def moves_when_it_tracks(guard, direction):
    """When the move was ordered (`time.monotonic`); INDI's EXOS-2 driver needs two reports to see that it tracks."""
    end = time.monotonic() + 90.0
    while True:
        ordered_s = time.monotonic()
        try:
            guard.move(direction, 0.5, 1.0)
            return ordered_s
        except RefusedError:
            if time.monotonic() > end:
                raise
            time.sleep(0.5)


def test_an_exos2_that_ignores_a_sync_is_said_to(tmp_path):
    """As it does until its hand control's keys were used."""
    with at_the_telescope("exos2", tmp_path, needs_keys=True) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        ra, dec = board.radec_deg()
        assert "ignored the sync" in said(lambda: guard.sync(ra, dec + 1.0, by_hand=True, confirmed=True))
        assert board.false_by_deg() < 0.01


def test_an_exos2_without_power_is_sent_nowhere_and_one_that_woke_up_is_not_called_parked(tmp_path):
    """INDI repeats its last place, and what its mount tells while it tracks differs by less than INDI passes on."""
    with at_the_telescope("exos2", tmp_path) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        board.cut_power(3600.0)
        heard = len(board.transcript)
        assert "is the mount switched on?" in said(lambda: run(guard.slew(*place(board, -50.0, 60.0))))
        assert not any(data[4] == GOTO for _, mark, data in board.transcript[heard:] if mark == "lost >")
        board.cut_power(0.0)
        wait_for(lambda: board.powered)
        assert "Sync first" in said(lambda: run(guard.rest("park")))
        assert {order.kind for order in board.orders} == {"goto"}


def test_a_command_that_finds_an_exos2_woken_up_leaves_word_for_the_next(tmp_path):
    """It is the mount's first report since, in answer to the first order; a later program sees nothing of it."""
    with at_the_telescope("exos2", tmp_path) as (board, guard, _):
        run(guard.slew(*place(board, -30.0, 60.0)))
        board.cut_power(0.5)
        wait_for(lambda: board.powered)
        assert "was it switched off and on?" in said(lambda: guard.goto(*place(board, -60.0, 45.0)))
        assert "Sync first" in guard.policy.slew_block_reason
        assert not board.false_slews()


def test_an_exos2_that_indi_has_not_heard_twice_is_sent_nowhere(tmp_path):
    with behind_indi("exos2", tmp_path, False, slew_deg_s=3.0) as (board, indi):
        indi.tell(board)
        board.reports_left = 2
        # Its driver refuses every Stop. The end of the session needs none: nothing was sent that moves the mount.
        with Guard(opened(board, indi), SITE, LIMITS, clock=board.clock) as guard:
            assert "hears nothing new" in said(lambda: guard.goto(*place(board, -40.0, 85.0)))
        assert board.orders == []


def test_a_goto_that_indis_exos2_driver_refuses_after_sending_it_is_stopped(tmp_path, monkeypatch):
    """Before it has seen two reports its table of states has no goto; nor has another driver that does not say so."""
    monkeypatch.setattr("kochab.gear.mounts.drivers.indi_last_heard.ONLY_LISTEN", frozenset())
    with behind_indi("exos2", tmp_path, False, slew_deg_s=3.0) as (board, indi):
        indi.tell(board)
        board.reports_left = 2
        sets_out = board.goto

        def goto():
            board.reports_left = inf  # earlier the driver may see two before the order
            sets_out()

        board.goto = goto
        with suppress(LineLostError), Guard(opened(board, indi), SITE, LIMITS, clock=board.clock) as guard:
            told = said(lambda: guard.goto(*place(board, -40.0, 85.0)))
            assert "moves all the same" in told or "cut its power" in told  # it refuses Stop as well, and sends it
        assert [order.kind for order in board.orders] == ["goto"]
        wait_for(lambda: not board.moving)
        assert board.radec_deg()[1] < 80.0


def test_indis_exos2_driver_for_an_intel_computer_which_hears_nothing_is_not_believed(tmp_path, monkeypatch):
    monkeypatch.setattr("tests.boards.indi.program_of", lambda kind, home: PROGRAMS[kind][0])
    with behind_indi("exos2", tmp_path, False) as (board, indi):
        indi.tell(board)
        if platform.machine() not in ("x86_64", "AMD64"):
            pytest.skip("only where a char has a sign")
        with pytest.raises(NoAnswerError, match="does not report where it points"):
            opened(board, indi)


@pytest.mark.parametrize("direction", [Direction.WEST, Direction.NORTH])
def test_a_stargo_whose_nudge_does_not_end_is_seen_to_run_on(direction, tmp_path):
    """INDI tells its place once a second: two looks within that time see the same one, of a mount that moves."""
    with at_the_telescope("stargo", tmp_path) as (board, guard, _):
        board.lose_stops(1)
        run(nudge(guard, direction, 252.0, rate_deg_s=0.1))
        assert not board.moving
