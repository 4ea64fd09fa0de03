"""Every rule on the emergency stop's way, one test each: without the rule the test fails."""

import threading
import time
from dataclasses import replace

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, NotStoppedError, RefusedError, StoppedError, StrayedError
from kochab.core.mount import Direction, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import slew_supervisor, standing
from kochab.gear.mounts.emergency_stop import Watchdog
from kochab.gear.mounts.serial_line import Conversation
from kochab.gear.mounts.slew_supervisor import slew_limit_s
from tests.gear.mounts.imaginary import SILENT, Imaginary, at, guarded
from tests.gear.mounts.scripted import CLASSIC_START, Lx200, ScriptedLink, transcript
from tests.gear.mounts.test_conformance import wait_for

BROKEN = LineLostError("The line broke.")


def failing(*errors):
    """What raises one error a call, and then nothing any more; ``calls`` counts."""
    left = list(errors)

    def call():
        call.calls += 1
        if left:
            raise left.pop(0)

    call.calls = 0
    return call


# -- a stop's second try ----------------------------------------------------------------------


def test_a_stop_that_is_not_answered_is_sent_a_second_time() -> None:
    guard, mount = guarded()
    guard.goto(*at(-45.0, 42.0))
    mount.stop = failing(SILENT)
    guard.stop()
    assert mount.stop.calls == 2
    assert not guard.emergency.moving


def test_a_stop_on_a_broken_line_is_said_at_once() -> None:
    guard, mount = guarded()
    mount.stop = failing(BROKEN, BROKEN)
    with pytest.raises(LineLostError, match="cut its power"):
        guard.stop()
    assert mount.stop.calls == 1
    assert not guard.emergency.unfinished, "nothing was moving"


def test_a_stop_that_twice_is_not_answered_leaves_the_motion_unfinished() -> None:
    guard, mount = guarded()
    guard.move(Direction.NORTH, 0.5, 2.0)
    mount.stop = failing(SILENT, SILENT)
    with pytest.raises(LineLostError):
        guard.stop()
    assert guard.emergency.unfinished


def test_a_mount_that_creeps_does_not_stand_still() -> None:
    guard, mount = guarded()
    real = mount.position

    def position():
        mount.here = (mount.here[0], mount.here[1] + 120.0 / 3600.0)
        return real()

    mount.position = position
    guard.stop()
    with pytest.raises(NotStoppedError):
        guard.emergency.confirm()


def test_a_silent_mount_is_not_waited_for_longer_than_a_moving_one(monkeypatch) -> None:
    """Each answer is waited for 3 s: after two of them Stop is sent again."""
    guard, mount = guarded()
    now = [0.0]
    monkeypatch.setattr(standing, "monotonic", lambda: now[0])

    def silent():
        now[0] += 3.0
        raise SILENT

    mount.state = silent
    guard.stop()
    with pytest.raises(NotStoppedError):
        guard.emergency.confirm()
    assert now[0] == 12.0
    assert mount.did == [("stop",), ("stop",)]


# -- reconnect stops what may still move --------------------------------------------------------


@pytest.mark.parametrize("why", ["moving", "unfinished"])
def test_a_reconnect_stops_what_may_still_move(why) -> None:
    guard, mount = guarded()
    fresh = Imaginary(*mount.here)
    guard._reopen = lambda: fresh
    if why == "moving":
        guard.goto(*at(-45.0, 42.0))
    else:
        guard.emergency.unfinished = True
    guard.reconnect()
    assert mount.did[-1] == ("close",)
    assert fresh.did == [("stop",)]
    assert not guard.emergency.moving
    assert not guard.emergency.unfinished


def test_a_reconnect_whose_stop_fails_stops_again_at_the_next() -> None:
    guard, mount = guarded()
    guard.move(Direction.NORTH, 0.5, 2.0)
    first, second = Imaginary(*mount.here), Imaginary(*mount.here)
    first.fails["stop"] = BROKEN
    guard._reopen = iter([first, second]).__next__
    with pytest.raises(LineLostError):
        guard.reconnect()
    guard.emergency.end()  # its time is over, but nobody saw it end
    guard.reconnect()
    assert second.did == [("stop",)]


def test_a_slew_whose_line_breaks_is_stopped_on_reconnect() -> None:
    guard, mount = guarded()
    slew = guard.slew(*at(-45.0, 42.0))
    next(slew)
    mount.state = failing(BROKEN)
    mount.stop = failing()
    with pytest.raises(LineLostError):
        run(slew)
    assert guard.emergency.unfinished
    fresh = Imaginary(*mount.here)
    guard._reopen = lambda: fresh
    guard.reconnect()
    assert fresh.did == [("stop",)]


def test_an_order_of_unknown_outcome_whose_stop_fails_is_unfinished() -> None:
    guard, mount = guarded()
    mount.fails = {"goto": SILENT, "stop": BROKEN}
    with pytest.raises(LineLostError):
        guard.goto(*at(-45.0, 42.0))
    assert guard.emergency.unfinished


def test_a_pulse_whose_answer_was_waited_for_too_long_is_still_unfinished() -> None:
    guard, mount = guarded()

    def pulse(direction, milliseconds):
        guard.emergency.end()  # its time is over while the answer is waited for
        raise SILENT

    mount.pulse, mount.fails = pulse, {"stop": BROKEN}
    with pytest.raises(LineLostError):
        guard.pulse(Direction.NORTH, 100)
    assert guard.emergency.unfinished


def test_leaving_a_guard_asks_nothing_over_a_line_that_is_lost() -> None:
    guard, mount = guarded()
    mount.state = failing(AssertionError("asked over a lost line"))
    guard.stop()
    with pytest.raises(LineLostError), guard:
        raise BROKEN
    assert mount.state.calls == 0


# -- what may be moving, and for how long --------------------------------------------------------


def test_a_short_pulse_does_not_shorten_the_time_of_a_long_move() -> None:
    guard, mount = guarded()
    mount.rates_deg_s = (0.5,)
    guard.move(Direction.NORTH, 0.5, 20.0)
    guard.pulse(Direction.NORTH, 100)
    until = guard.emergency._moves_until - time.monotonic()
    assert until > 20.0


@pytest.mark.parametrize(("order", "lasts_s"), [("move", 1.0), ("pulse", 1.0)])
def test_a_bounded_motion_may_be_moving_longer_than_it_was_sent_for(order, lasts_s) -> None:
    """The mount begins late and its motors run out."""
    guard, _ = guarded()
    if order == "move":
        guard.move(Direction.NORTH, 0.5, lasts_s)
    else:
        guard.pulse(Direction.NORTH, round(lasts_s * 1000.0))
    assert guard.emergency._moves_until - time.monotonic() > lasts_s + 0.3


def test_a_goto_may_be_moving_until_the_mount_says_for_a_while_that_it_is_not(monkeypatch) -> None:
    """At first it may not have begun."""
    now = [100.0]
    monkeypatch.setattr(slew_supervisor, "monotonic", lambda: now[0])
    guard, mount = guarded()
    guard.goto(*at(-45.0, 42.0))
    assert guard.emergency.endless
    for slewing in (False, True, False):
        now[0] += 1.5
        mount.now = replace(mount.now, slewing=slewing)
        guard.state()
        assert guard.emergency.moving
    now[0] += 1.7
    guard.state()
    assert not guard.emergency.moving
    guard.close()
    assert mount.did[-1] == ("close",)
    assert ("stop",) not in mount.did


def test_a_goto_that_the_mount_refuses_moves_nothing() -> None:
    guard, mount = guarded()
    mount.fails["goto"] = RefusedError("The mount refuses to go there.")
    with pytest.raises(RefusedError):
        guard.goto(*at(-45.0, 42.0))
    assert not guard.emergency.moving
    assert ("stop",) not in mount.did


def test_a_slew_that_has_ended_moves_nothing() -> None:
    guard, _ = guarded()
    run(guard.slew(*at(-45.0, 42.0)))
    assert not guard.emergency.moving


def test_closing_stops_a_bounded_motion() -> None:
    guard, mount = guarded()
    guard.move(Direction.NORTH, 0.5, 20.0)
    guard.close()
    assert [name for name, *_ in mount.did] == ["move", "stop", "close"]


def test_a_program_that_ends_stops_a_bounded_motion_too() -> None:
    guard, mount = guarded()
    guard.move(Direction.NORTH, 0.5, 20.0)
    guard._finalizer()
    assert mount.did[-1] == ("stop",)


def test_a_parked_mount_is_not_made_to_track() -> None:
    guard, mount = guarded()
    mount.now = replace(mount.now, parked=True)
    with pytest.raises(RefusedError, match="parked"):
        guard.track(TrackingRate.SIDEREAL)
    assert mount.did == []


# -- arrival --------------------------------------------------------------------------------------


def slewing_to(target, *reports, start=(-40.0, 40.0), **limits):
    """A slew whose mount reports (slewing, hour angle, Dec) one after the other, then the last again."""
    guard, mount = guarded(*start, **limits)
    slew = guard.slew(*at(*target))
    next(slew)
    left = list(reports)

    def state():
        slewing, *place = left.pop(0) if len(left) > 1 else left[0]
        if isinstance(slewing, Exception):
            raise slewing
        mount.here = at(*place)
        return replace(mount.now, slewing=slewing)

    mount.state = state
    return guard, mount, slew, left


def test_the_way_left_is_told_as_a_share_of_the_first_report(monkeypatch) -> None:
    """A detour is no less than nothing done."""
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    target = (-40.0, 50.0)
    decs = (42.0, 46.0, 41.5, 49.0, 50.0)
    _, _, slew, _ = slewing_to(target, *((True, -40.0, dec) for dec in decs), (False, *target))
    told = list(slew)
    assert [one.fraction for one in told] == pytest.approx([0.0, 0.5, 0.0, 0.875, 1.0], abs=1e-3)
    assert [one.detail for one in told] == [f"{50.0 - dec:.1f} deg to go" for dec in decs]


def test_a_mount_that_stands_elsewhere_has_not_arrived(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    _, mount, slew, _ = slewing_to((-45.0, 42.0), (False, -42.0, 41.0))
    with pytest.raises(RefusedError, match=r"stopped \d\.\d deg from its target"):
        run(slew)
    assert mount.did[-1] == ("stop",)


def test_a_mount_that_stops_at_its_home_on_the_way_needs_a_sync(monkeypatch) -> None:
    """A short cut behind a slow server: no answer was missed, and its motors could have gone there by themselves."""
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    reports = (True, -42.0, 41.0), (True, 0.0, 89.5), (False, 0.0, 89.5)
    guard, _, slew, _ = slewing_to((-45.0, 42.0), *reports, allow_flip=True)
    with pytest.raises(RefusedError, match=r"at its home or park position instead .* Sync first"):
        run(slew)
    with pytest.raises(RefusedError, match="Sync first"):
        guard.goto(*at(-45.0, 42.0))


def test_a_mount_that_never_left_its_home_is_not_called_restarted(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    guard, _, slew, _ = slewing_to((-45.0, 42.0), (False, 0.0, 89.5), start=(0.0, 89.5), allow_flip=True)
    with pytest.raises(RefusedError, match="from its target"):
        run(slew)
    assert not guard.policy.restarted


def test_a_slew_that_begins_late_is_waited_for(monkeypatch) -> None:
    """A mount may take a second before it says that it slews."""
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    start = (False, -40.0, 40.0)
    reports = [start] * 6  # 1.2 s
    reports += [(True, -42.0, 41.0), (False, -45.0, 42.0)]
    _, mount, slew, left = slewing_to((-45.0, 42.0), *reports)
    run(slew)
    assert len(left) == 1
    assert mount.did[-1][0] == "goto"


@pytest.mark.parametrize("order", [lambda guard: guard.slew(*at(-45.0, 42.0)), lambda guard: guard.rest("home")])
def test_a_mount_that_is_parked_on_its_way_is_not_taken_for_mute(order) -> None:
    """By its hand control, or by another program."""
    guard, mount = guarded()
    mount.slew_deg_s = 1.0
    task = order(guard)
    told = [next(task)]
    mount.state = lambda: replace(mount.now, parked=True, at_home=None)
    with pytest.raises(RefusedError, match="was parked on its way"):
        told.extend(task)
    assert not any(one.detail for one in told), "nobody needs to cut its power"
    assert mount.did[-1] == ("stop",)


def test_a_slew_that_begins_late_is_watched_on_its_way(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    _, mount, slew, _ = slewing_to((-45.0, 42.0), (False, -40.0, 40.0), (True, -40.0, 30.0))
    with pytest.raises(StrayedError, match="wrong way"):
        run(slew)
    assert mount.did[-1] == ("stop",)


def test_pauses_of_a_slew_do_not_add_up(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    pauses = []
    for k in range(3):
        pauses += [(False, -41.0 - k, 40.0)] * 6 + [(True, -41.5 - k, 40.0)]
    _, mount, slew, _ = slewing_to((-45.0, 42.0), *pauses, (False, -45.0, 42.0))
    run(slew)
    assert mount.did[-1][0] == "goto"


def test_a_mount_that_does_not_report_slewing_has_arrived_when_it_stands_there(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    passing = (None, -45.0, 42.0 - 0.4)
    guard, _, slew, left = slewing_to(
        (-45.0, 42.0), (None, -42.0, 41.0), passing, (None, -45.0, 42.0), (None, -45.0, 42.0)
    )
    run(slew)
    assert len(left) == 1, "it was not taken for there while it passed"
    assert not guard.emergency.moving


def test_so_many_answers_may_be_missed_and_not_one_more(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    missed, seen, there = (SILENT,), (True, -42.0, 41.0), (False, -45.0, 42.0)
    some = [missed] * 2
    _, mount, slew, _ = slewing_to((-45.0, 42.0), *some, seen, *some, seen, there)
    run(slew)
    assert mount.did[-1][0] == "goto"
    _, mount, slew, _ = slewing_to((-45.0, 42.0), seen, *[missed] * 3, there)
    with pytest.raises(NoAnswerError):
        run(slew)
    assert mount.did[-1] == ("stop",)


@pytest.mark.parametrize(
    ("limits", "seconds"),
    [
        ({"slew_start_s": 7.0, "slowest_slew_deg_s": 1e9}, 7.0),
        ({"slew_timeout_s": 3.0}, 3.0),
        ({"slew_start_s": 0.0, "slowest_slew_deg_s": 0.5, "crosses_meridian": True}, 20.0),
    ],
)
def test_a_slew_may_last_as_long_as_its_limits_say(limits, seconds) -> None:
    guard, _ = guarded(**limits)
    assert slew_limit_s(guard._begin_slew(*at(-40.0, 30.0))) == pytest.approx(seconds, rel=0.01)


# -- overrun: how far a move may be seen -----------------------------------------------------------


@pytest.mark.parametrize(("rates", "seen_deg"), [((1.0,), 2.5), ((), 10.0)])
def test_a_move_may_overrun_by_what_its_rate_is_known(rates, seen_deg, monkeypatch) -> None:
    """Of 2 deg a quarter more, where the mount does not report its rates a quarter more than four times that."""
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    monkeypatch.setattr(slew_supervisor, "ASIDE_DEG", 0.6)  # the region is a grid
    for beyond, strays in ((-0.3, False), (0.9, True)):
        guard, mount = guarded()
        mount.rates_deg_s = rates
        guard.move(Direction.NORTH, 1.0, 2.0)
        mount.here = at(-40.0, 40.0 + seen_deg + beyond)
        if strays:
            with pytest.raises(StoppedError, match="wrong way"):
                guard.position()
        else:
            guard.position()


def test_a_new_motion_forgets_how_the_last_one_strayed(monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)
    guard, mount = guarded()
    guard.move(Direction.NORTH, 1.0, 2.0)
    mount.here = at(-40.0, 20.0)
    with pytest.raises(StoppedError):
        guard.position()
    guard.move(Direction.SOUTH, 1.0, 2.0)
    guard.check_not_stopped(guard.stops, "move")


# -- the watchdog ----------------------------------------------------------------------------------


def expired(*errors):
    dog, halt = Watchdog(), failing(*errors)
    dog.arm("ra", 0.0, halt).join()
    return dog, halt


def test_the_watchdog_tries_three_times() -> None:
    dog, halt = expired(SILENT, SILENT)
    assert halt.calls == 3
    dog.check()  # the third worked
    assert not dog.moving
    dog, halt = expired(*[SILENT] * 4)
    assert halt.calls == 3
    dog.arm("dec", 0.0, failing()).join()
    assert dog.moving, "what ended the other axis did not end this one"
    with pytest.raises(NotStoppedError, match="CUT ITS POWER"):
        dog.check()
    dog.check()  # told once
    assert not dog.moving
    dog, _ = expired(*[SILENT] * 3)
    dog.disarm()
    dog.check()  # Stop was sent since


def test_a_move_that_could_not_be_ended_is_stopped_by_whoever_asks_where_the_mount_is() -> None:
    """On INDI a missed answer, which a nudge forgives."""
    for fails, told in (({}, NotStoppedError), ({"stop": BROKEN}, LineLostError)):
        guard, mount = guarded()
        dog, _ = expired(*[SILENT] * 3)
        mount.position = lambda check=dog.check, here=mount.position: check() or here()
        mount.fails = fails
        with pytest.raises(told, match=r"(?i)cut its power"):
            guard.position()
        assert mount.did == [("stop",)]
        assert guard.emergency.unfinished is bool(fails), "the next connection begins with Stop"


def test_the_watchdog_ends_a_motion_once() -> None:
    _, halt = expired()
    assert halt.calls == 1


def test_a_motion_that_is_prolonged_or_ended_is_not_ended_again() -> None:
    dog, first, second, other = Watchdog(), failing(), failing(), failing()
    dog.arm("ra", 0.05, first)
    dog.arm("dec", 0.05, other)
    dog.arm("ra", 30.0, second)
    wait_for(lambda: other.calls == 1)
    time.sleep(0.1)
    assert dog.moving
    assert first.calls == second.calls == 0
    dog.disarm()
    assert not dog.moving
    dog.arm("ra", 0.05, first)
    dog.disarm()
    time.sleep(0.15)
    assert first.calls == 0


def test_a_move_that_expires_does_not_forget_the_next_one() -> None:
    """Its halt may wait three seconds for an answer; the next move of that axis may begin meanwhile."""
    dog = Watchdog()

    def halt():
        dog.arm("ra", 30.0, failing())

    dog.arm("ra", 0.0, halt).join()
    assert dog.moving
    dog.disarm()


def test_a_move_whose_end_failed_is_told_before_the_next() -> None:
    link = ScriptedLink(CLASSIC_START)
    mount = Lx200(link)
    mount.watchdog.failure = BROKEN
    with pytest.raises(NotStoppedError, match="The line broke"):
        mount.bounded(Direction.NORTH, 1.0)


def test_stop_disarms_the_watchdog_and_closing_stops_a_move() -> None:
    begin = [*CLASSIC_START, (b":RM#", b""), (b":Mn#", b"")]
    with transcript(Lx200, [*begin, (b":Q#", b"")]) as mount:
        mount.move(Direction.NORTH, 2.0, 30.0)
        mount.stop()
        assert not mount.watchdog.moving
    with transcript(Lx200, [*begin, (b":Q#", b"")]) as mount:
        mount.move(Direction.NORTH, 2.0, 30.0)
        mount.close()


def test_nothing_is_sent_between_a_stop_and_its_bytes() -> None:
    """A driver's Stop is several commands: no other goes between them."""
    link = ScriptedLink([(b":Q#", b""), (b":GR#", b"")])
    talk = Conversation(link)
    talk.stopping()
    asking = threading.Thread(target=talk.send, args=(b":GR#",))
    asking.start()
    time.sleep(0.1)
    talk.send_now((b":Q#", ()))
    talk.stopped()
    asking.join(5.0)
    link.finished()
