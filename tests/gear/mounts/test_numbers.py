"""The numbers of a mount's guard, its watch and its line, each from both sides."""

import errno
import sys
from dataclasses import replace
from datetime import timedelta
from math import sqrt
from time import monotonic

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.errors import NoAnswerError, NotStoppedError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Direction, Epoch, MountState, PierSide, Pointing, SiteReport
from kochab.core.progress import run
from kochab.gear.mounts import emergency_stop, serial_line, slew_supervisor, standing
from kochab.gear.mounts.serial_line import Conversation, SerialLink, not_opened
from kochab.gear.mounts.slew_supervisor import SupervisedMotion, allowed_region, anywhere, may_flip, slew_limit_s

from .imaginary import NIGHT, SITE, at, guarded
from .test_motion_rules import AWAKE, plan

# -- The guard ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ahead_s", "words"),
    [
        (119.0, ""),
        (121.0, "its clock is 2 min fast"),
        (-121.0, "its clock is 2 min slow"),
        (1919.0, "32 min fast (summer time or zone?)"),
        (1921.0, "32 min fast. Before"),
        (3479.0, "58 min fast. Before"),
        (3481.0, "1.0 h fast (summer time or zone?)"),
        (1.49 * 86400.0, "35.8 h fast"),
        (-1.51 * 86400.0, "its date is 2026-01-14"),
    ],
)
def test_a_clock_is_doubted_from_two_minutes_on(ahead_s, words) -> None:
    guard, mount = guarded()
    mount.site_report = lambda: SiteReport(time_utc=NIGHT + timedelta(seconds=ahead_s))
    assert (words in guard.clock_doubt()) if words else guard.clock_doubt() == ""


@pytest.mark.parametrize(
    ("east", "north", "doubted"), [(0.0, 0.49, False), (0.0, 0.51, True), (0.7, 0.0, False), (0.9, 0.0, True)]
)
def test_a_site_is_doubted_from_half_a_degree_on(east, north, doubted) -> None:
    """On the ground: at a latitude of 50 deg 0.78 deg of longitude are that far."""
    guard, mount = guarded()
    mount.site_report = lambda: SiteReport(site=Site(SITE.latitude_deg + north, SITE.longitude_deg + east))
    assert ("its site is" in guard.clock_doubt()) is doubted


def test_the_longest_moves_and_pulses_are_allowed_and_watched_a_little_longer() -> None:
    guard, mount = guarded(dec_deg=0.0, lowest_altitude_deg=-90.0)
    watched = []
    guard.emergency.begin = lambda seconds, _: watched.append(seconds)
    guard.move(Direction.NORTH, 0.5, 60.0)
    guard.move(Direction.NORTH, 1.9, 50.0)
    guard.pulse(Direction.NORTH, 5000)
    guard.pulse(Direction.NORTH, 1)
    assert watched == pytest.approx([62.0, 52.0, 5.5, 0.501])
    assert [did[0] for did in mount.did] == ["move", "move", "pulse", "pulse"]


@pytest.mark.parametrize(("off_arcsec", "taken"), [(119.0, True), (121.0, False)])
def test_a_sync_is_read_back_to_two_arcminutes(off_arcsec, taken) -> None:
    guard, mount = guarded()

    def rounded(ra_deg, dec_deg):
        mount.here = (ra_deg, dec_deg + off_arcsec / 3600.0)

    mount.sync = rounded
    if taken:
        guard.sync(*at(-41.0, 40.0), by_hand=True)
        assert guard.can_undo
    else:
        with pytest.raises(NoAnswerError, match="is not known"):
            guard.sync(*at(-41.0, 40.0), by_hand=True)


# -- The emergency stop --------------------------------------------------------------------------------------


def stopped(*places, clock_step_s=0.0, slewing=False):
    """A guard that has sent Stop, and whose mount will report these declinations; what it waits, and how often it asks."""
    guard, mount = guarded()
    waits, left, now = [], list(places), [NIGHT]
    stop = emergency_stop.EmergencyStop(mount, guard.log, lambda: now[0], waits.append)

    def position():
        now[0] += timedelta(seconds=clock_step_s)
        return Pointing(0.0, left.pop(0) if len(left) > 1 else left[0], Epoch.DATE)

    mount.position, mount.now = position, replace(mount.now, slewing=slewing)
    stop.halt()
    return stop, mount, waits


@pytest.mark.parametrize(
    ("moved_arcsec", "step_s", "still"), [(2.4, 0.0, True), (5.2, 0.0, False), (32.0, 10.0, True), (36.0, 10.0, False)]
)
def test_a_mount_is_at_rest_within_five_arcseconds_and_what_a_drive_wanders(moved_arcsec, step_s, still) -> None:
    """In ten seconds a fifth of what the sky turns is 30 arcsec; the clock that ran more counts."""
    places = [0.0001234 + k * moved_arcsec / 3600.0 for k in range(40)]
    stop, mount, waits = stopped(*places, clock_step_s=step_s)
    if still:
        stop.confirm()
        assert waits == [0.7] * 2
    else:
        with pytest.raises(NotStoppedError, match="CUT ITS POWER"):
            stop.confirm()
        assert mount.did == [("stop",)] * 2
        assert waits == [0.7] * 6  # four looks after each Stop


def test_a_mount_that_slews_where_it_stands_is_not_at_rest() -> None:
    with pytest.raises(NotStoppedError):
        stopped(0.0, slewing=True)[0].confirm()


@pytest.mark.parametrize(("look_s", "looks"), [(3.9, 3), (4.1, 2)])
def test_a_mount_that_answers_slowly_is_asked_for_four_seconds(monkeypatch, look_s, looks) -> None:
    """A new look begins only within that time: two of 3.9 s, one of 4.1 s, and the same after the second Stop."""
    now = [0.0]
    monkeypatch.setattr(standing, "monotonic", lambda: now[0])
    stop, mount, _ = stopped(0.0)
    asked = []

    def state():
        asked.append(now[0])
        now[0] += look_s
        raise NoAnswerError("silent")

    mount.state = state
    with pytest.raises(NotStoppedError):
        stop.confirm()
    assert len(asked) == 2 * (looks - 1)


# -- The watch over a motion ---------------------------------------------------------------------------------


def seen(passed_s=1.0, target=(0.0, 60.0), region=None):
    """A motion from hour angle -40, declination 20, and a place reported later."""
    asked = plan(at(-40.0, 20.0), at(*target), crosses_meridian=True, longest_slew_deg=180.0)
    motion = SupervisedMotion(asked, anywhere() if region is None else region)
    return lambda hour, dec: (
        motion.finding(Pointing(*at(hour, dec), Epoch.DATE), NIGHT + timedelta(seconds=passed_s), monotonic()) or ""
    )


@pytest.mark.parametrize(("off_deg", "jumps"), [(0.45, False), (0.55, True)])
def test_half_a_degree_from_its_target_it_may_have_got_there_unseen(off_deg, jumps) -> None:
    assert ("jumped" in seen(0.1)(0.0, 60.0 + off_deg)) is jumps


@pytest.mark.parametrize(("passed_s", "due"), [(1.4, False), (1.6, True)])
def test_a_position_is_due_after_a_second_and_a_half(monkeypatch, passed_s, due) -> None:
    now = [100.0]
    monkeypatch.setattr(slew_supervisor, "monotonic", lambda: now[0])
    motion = SupervisedMotion(plan(at(-40.0, 20.0), at(0.0, 60.0)), anywhere())
    now[0] += passed_s
    assert motion.due is due
    motion.finding(Pointing(*at(-40.0, 20.0), Epoch.DATE), NIGHT, now[0])
    assert not motion.due
    now[0] += passed_s  # a look that was long asked for
    motion.finding(Pointing(*at(-40.0, 20.0), Epoch.DATE), NIGHT, now[0] - passed_s)
    assert motion.due is due


def test_a_region_has_a_place_every_two_degrees() -> None:
    """So that no place within is farther than half the diagonal from one of them."""
    rng = np.random.default_rng(4)
    region = allowed_region(plan(at(-70.0, -5.0), at(-10.0, 10.0)))
    for hour, dec in zip(rng.uniform(-70.0, -10.0, 300), rng.uniform(-5.0, 10.0, 300), strict=True):
        assert np.degrees(np.arccos((region @ unit_vectors(*at(hour, dec))).max())) < sqrt(2.0) + 0.02
    whole = anywhere()
    places = unit_vectors(rng.uniform(0.0, 360.0, 300), np.degrees(np.arcsin(rng.uniform(-1.0, 1.0, 300))))
    assert np.degrees(np.arccos((places @ whole.T).max(axis=1))).max() < sqrt(2.0) + 0.02
    assert len(whole) == 181 * 91


@pytest.mark.parametrize(
    ("start", "target", "state", "limits", "flips"),
    [
        (-10.0, -20.0, AWAKE, {}, False),
        (-10.0, 20.0, AWAKE, {}, True),
        (20.0, 25.0, AWAKE, {}, True),  # it may have followed a star past the meridian
        (29.0, 35.0, AWAKE, {}, True),
        (31.0, 35.0, AWAKE, {}, False),
        (-10.0, 20.0, replace(AWAKE, pier_side=PierSide.WEST), {}, False),
        (-10.0, -20.0, replace(AWAKE, pier_side=PierSide.WEST), {"allow_flip": True}, True),
        (-10.0, 20.0, AWAKE, {"crosses_meridian": True}, False),
        (-10.0, 20.0, replace(AWAKE, pier_side=PierSide.WEST), {"crosses_meridian": True}, True),  # no fork, it says
    ],
)
def test_a_mount_may_flip_across_the_meridian_and_half_an_hour_behind_it(start, target, state, limits, flips) -> None:
    asked = plan(at(start, 40.0), at(target, 41.0), state=state, **limits)
    assert may_flip(asked) is flips
    assert may_flip(replace(asked, site=None)) is (flips or (state.pier_side is None and not limits))
    turn = 180.0 if flips else abs(target - start)
    assert slew_limit_s(asked) == pytest.approx(min(240.0, 30.0 + 4.0 * turn))


def arriving(left_deg, slewing, moves_deg=0.0):
    """A slew whose mount stands so far from its target; how often it was looked at."""
    guard, mount = guarded()
    target, count = at(-41.0, 40.0), [0, guard]  # a guard that is dropped would look whether its mount stands
    slew = guard.slew(*target)
    next(slew)
    mount.now = replace(mount.now, slewing=slewing)

    def position():
        count[0] += 1
        return Pointing(target[0], target[1] + left_deg + moves_deg * (count[0] % 2), Epoch.DATE)

    mount.position = position
    return slew, count


@pytest.mark.parametrize(("missed", "rows", "given_up"), [(2, 3, False), (3, 1, True)])
def test_a_slew_may_miss_two_answers_in_a_row(missed, rows, given_up) -> None:
    """A third, at 4.5 s each, is too long a time to be blind in; those before an answer do not count."""
    guard, mount = guarded()
    target = at(-41.0, 40.0)
    slew = guard.slew(*target)
    next(slew)
    answers = ([True] * missed + [False]) * rows
    mount.now = replace(mount.now, slewing=True)

    def position():
        if answers and answers.pop(0):
            raise NoAnswerError("It is silent.")
        if not answers:
            mount.now = replace(mount.now, slewing=False)
        return Pointing(*target, Epoch.DATE)

    mount.position = position
    if given_up:
        with pytest.raises(NoAnswerError):
            run(slew)
        assert mount.did[-1] == ("stop",)
    else:
        run(slew)
        assert ("stop",) not in mount.did


@pytest.mark.parametrize(("left_deg", "looks"), [(0.45, 1), (0.55, 8)])
def test_a_mount_that_stands_half_a_degree_off_may_not_have_begun(left_deg, looks) -> None:
    slew, count = arriving(left_deg, False)
    if looks == 1:
        run(slew)
    else:
        with pytest.raises(RefusedError, match=r"stopped 0\.[56] deg from its target"):
            run(slew)
    assert count[0] == looks


@pytest.mark.parametrize(("moves_deg", "rests"), [(0.0008, True), (0.0012, False)])
def test_without_a_word_of_slewing_it_stands_when_it_comes_no_nearer(moves_deg, rests) -> None:
    slew, count = arriving(0.1, None, moves_deg=moves_deg)
    if rests:
        run(slew)
        assert count[0] == 2
    else:
        for _ in range(40):
            next(slew)


@pytest.mark.parametrize(("moved_deg", "rests"), [(0.009, True), (0.011, False)])
def test_on_its_way_home_it_rests_when_it_has_moved_a_hundredth_of_a_degree(moved_deg, rests) -> None:
    guard, mount = guarded()
    count = [0]
    home = guard.rest("home")
    next(home)

    def position():
        count[0] += 1
        return Pointing(at(-40.0, 40.0)[0], 40.0 + moved_deg * (count[0] % 2), Epoch.DATE)

    mount.position, mount.state = position, lambda: MountState(slewing=False)
    if rests:
        run(home)
        assert count[0] == 9
    else:
        for _ in range(40):
            next(home)


# -- The line ------------------------------------------------------------------------------------------------


# Windows refuses what is in use by this very error.
NO_PERMISSION = "is in use" if sys.platform == "win32" else "No permission to open {}"


@pytest.mark.parametrize(
    ("port", "error", "words"),
    [
        ("socket://mount:x", ValueError(), "is not an address: write it as socket://HOST:PORT"),
        ("socket://mount", ValueError(), "is not an address"),
        ("udp://:11880", ValueError(), "is not an address: write it as udp://HOST:PORT"),
        ("socket://mount:99", OSError("Connection refused"), "No answer at socket://mount:99"),
        ("socket://mount:99", OSError("no route"), "cannot be reached"),
        ("loop://", ValueError(), "loop:// is not a port: give a device"),
        ("/dev/ttyX", OSError(errno.EACCES, ""), NO_PERMISSION.format("/dev/ttyX: ask")),
        ("/dev/null", OSError(errno.EPERM, ""), NO_PERMISSION.format("/dev/null")),
        ("/dev/ttyX", OSError(errno.EBUSY, ""), "is in use"),
        ("/dev/ttyX", OSError(errno.EAGAIN, ""), "is in use"),
        ("COM3", OSError("PermissionError: Access is denied"), "is in use"),
        ("/dev/ttyX", OSError("Could not exclusively lock port"), "is in use"),
        ("/dev/ttyX", OSError(errno.ENOENT, ""), "No port /dev/ttyX: plug in"),
        ("com7", OSError("FileNotFoundError"), "No port com7: plug in"),
        ("/tmp/nothing", OSError(errno.ENXIO, ""), "No port /tmp/nothing: list"),
        ("/nowhere/x", OSError(errno.ENODEV, ""), "No port /nowhere/x, nor its folder"),
        ("/dev/ttyX", OSError(errno.EIO, ""), "cannot be used as a serial port"),
    ],
)
def test_a_port_that_does_not_open_says_what_to_do(port, error, words) -> None:
    assert words in str(not_opened(port, error))


class Line:
    """A link that has these replies, one a question, and keeps what is sent."""

    port, lossy = "line", False

    def __init__(self, *replies, lossy=False):
        self.replies, self.lossy = list(replies), lossy
        self.sent, self.quiet = [], []

    def write(self, data):
        self.sent.append(data)

    def read(self, _link=None):
        reply = self.replies.pop(0) if self.replies else None
        if reply is None:
            raise NoAnswerError("silent")
        return reply

    def discard(self, quiet_s=0.0):
        self.quiet.append(quiet_s)
        return b""


def test_after_a_bad_answer_the_line_falls_silent_before_two_exchanges() -> None:
    line = Line(None, b"1", b"1", b"1")
    talk = Conversation(line)
    with pytest.raises(NoAnswerError):
        talk.ask(b"a", lambda link: link.read(), bytes)
    for _ in range(3):
        talk.ask(b"a", lambda link: link.read(), bytes)
    assert line.quiet == [0.0, serial_line.QUIET_S, serial_line.QUIET_S, 0.0]


@pytest.mark.parametrize(("lossy", "times"), [(False, 2), (True, 12)])
def test_a_stop_that_is_not_answered_is_sent_twice_and_twelve_times_over_a_line_that_loses(lossy, times) -> None:
    line = Line(lossy=lossy)
    talk = Conversation(line)
    talk.send_now((b"stop", (lambda link: link.read(),)))
    talk.read_pending()
    assert line.sent == [b"stop"] * times
    talk.read_pending()
    assert len(line.sent) == times, "nothing is due any more"


@pytest.mark.parametrize("tries", [1, 2, 5])
def test_a_question_is_asked_as_often_as_it_may_be(tries) -> None:
    line = Line()
    with pytest.raises(NoAnswerError):
        Conversation(line).query(b"a", lambda link: link.read(), bytes, tries, NoAnswerError)
    assert len(line.sent) == tries


class Port:
    """A serial port with these bytes; each read takes a second of ``now``."""

    def __init__(self, data, now, endless=False):
        self.data, self.now, self.endless = data, now, endless

    def read(self, count):
        self.now[0] += 1.0
        piece, self.data = self.data[:count], self.data[count:]
        return b"x" if self.endless else piece

    @property
    def in_waiting(self):
        return 1 if self.endless else len(self.data)


@pytest.fixture
def link(monkeypatch):
    """A link over such a port, and its clock."""

    def made(data=b"", **how):
        now = [0.0]
        found = object.__new__(SerialLink)
        found.port, found._lost, found._serial = "/dev/ttyX", False, Port(data, now, **how)
        monkeypatch.setattr(serial_line, "monotonic", lambda: now[0])
        return found, now

    return made


def test_a_line_that_never_falls_silent_is_read_for_two_seconds(link) -> None:
    line, _ = link(endless=True)
    assert line.discard() == b"xxx"
    for quiet_s, end_s in ((0.0, 1.0), (0.5, 2.0)):
        line, now = link(b"a")
        assert line.discard(quiet_s) == b"a"
        assert now[0] == end_s


def test_an_answer_is_read_to_its_end_or_its_length(link) -> None:
    assert link(b"12345")[0].read_exact(3, 9.0) == b"123"
    assert link(b"1234#5")[0].read_until(b"#", 5, 9.0) == b"1234#"
    with pytest.raises(NoAnswerError, match=r"never ends its reply: b'1234'"):
        link(b"1234#")[0].read_until(b"#", 4, 9.0)
    with pytest.raises(NoAnswerError, match=f"stopped after b'{'y' * 24}'"):
        link(b"y" * 30)[0].read_exact(40, 50.0)
    with pytest.raises(NoAnswerError, match="did not answer within 5 s"):
        link()[0].read_exact(1, 5.0)
