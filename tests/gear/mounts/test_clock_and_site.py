"""A mount whose clock or site contradicts the computer's: no slew and no sync before it is settled."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from types import SimpleNamespace

import pytest

from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, SiteReport
from kochab.core.progress import run
from kochab.gear.mounts import DRIVERS, SERVERS
from kochab.gear.mounts.clock_and_site import wall_clock
from kochab.gear.mounts.drivers.lx200 import Lx200, OnStep
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.simulate.serial_line import own_line
from kochab.text.translation import speak
from tests.gear.mounts.bench import COUNTERS, LIMITS, SITE, Night, alpaca, moved, opened, place
from tests.gear.mounts.imaginary import NIGHT, at, guarded
from tests.gear.mounts.scripted import transcript
from tests.gear.mounts.test_real_transcripts import GPS_START
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.dialects import open_any

HOUR = timedelta(hours=1)
ELSEWHERE = Site(48.0, -8.0)


def believing(report, **limits):
    """A guard around a mount that tells this of its clock and site, and can be told otherwise."""
    guard, mount = guarded(**limits)
    believes = SimpleNamespace(report=report, asked=0)

    def tell():
        believes.asked += 1
        if isinstance(believes.report, Exception):
            raise believes.report
        return believes.report

    def take(**new):
        believes.report = SiteReport(
            new.get("site", believes.report.site), new.get("time_utc", believes.report.time_utc)
        )

    mount.site_report = tell
    mount.set_clock = lambda now: take(time_utc=now)
    mount.set_site = lambda site: take(site=site)
    return guard, mount, believes


def refused(guard, match):
    """Goto, offset move and sync, with not a byte sent."""
    before = list(guard.mount.did)
    for order in (
        lambda: guard.goto(*at(-30.0, 50.0)),
        lambda: run(guard.slew(*at(-30.0, 50.0))),
        lambda: guard.sync(*at(-38.0, 41.0), by_hand=True, confirmed=True),
        lambda: guard.move(Direction.EAST, 1.0, 10.0),
    ):
        with pytest.raises(RefusedError, match=match):
            order()
    assert any(re.search(match, refusal) for refusal in guard.preview_goto(*at(-30.0, 50.0)).refusals)
    assert guard.mount.did == before


@pytest.mark.parametrize(
    ("ahead", "site", "told"),
    [
        (timedelta(seconds=-90.0), Site(50.2, 8.2), ""),  # its clock was set by hand, its site is the next town
        (-HOUR, None, r"its clock is 1.0 h slow \(summer time or zone\?\)"),
        (timedelta(seconds=300.0), None, "its clock is 5 min fast[.]"),
        (5.5 * HOUR, None, r"its clock is 5.5 h fast \(summer time or zone\?\)"),
        (-9000 * 24 * HOUR, None, "its date is 2001-05-26"),  # never set
        (None, Site(50.0, -8.0), "its site is 50, -8, not 50, 8"),
        (2 * HOUR, Site(-50.0, 8.0), "its clock is 2.0 h fast .* and its site is -50, 8, not 50, 8"),
        (None, None, ""),
    ],
)
def test_a_contradiction_forbids_what_needs_the_sky_and_nothing_else(ahead, site, told) -> None:
    guard, mount, believes = believing(SiteReport(site, None if ahead is None else NIGHT + ahead))
    if not told:
        guard.goto(*at(-30.0, 50.0))
        guard.sync(*at(-31.0, 50.0), by_hand=True, confirmed=True)
        assert believes.asked == 1, "once, as long as it agrees"
        return
    refused(guard, told)
    guard.move(Direction.NORTH, 0.25, 4.0)  # a degree, or four where the mount does not tell its rates
    guard.pulse(Direction.WEST, 500)
    guard.stop()
    run(guard.rest("park"))
    assert [entry[0] for entry in mount.did] == ["move", "pulse", "stop", "park"]


def test_a_clock_set_on_the_hand_control_is_seen_at_the_next_slew() -> None:
    guard, mount, believes = believing(SiteReport(None, NIGHT - HOUR))
    refused(guard, "1.0 h slow")
    believes.report = SiteReport(None, NIGHT)
    guard.goto(*at(-30.0, 50.0))
    assert mount.did[-1][0] == "goto"


def test_a_person_may_say_that_the_mount_is_right_until_it_was_switched_off_or_the_site_is_another() -> None:
    for again in (lambda guard: guard.reconnect(), lambda guard: setattr(guard, "site", SITE)):
        guard, mount, _ = believing(SiteReport(None, NIGHT - HOUR))
        guard._reopen = lambda mount=mount: setattr(mount, "closed", False) or mount
        refused(guard, "say that the mount is right")
        guard.clock_and_site.trust()
        guard.goto(*at(-30.0, 50.0))
        assert guard.clock_doubt() == ""
        guard.stop()
        guard.position()  # it stands where it was sent, so that a line that breaks now is no silent jump
        again(guard)
        refused(guard, "1.0 h slow")


def test_an_answer_that_is_missed_once_is_asked_for_again_and_a_mount_that_tells_nothing_is_not_held_up() -> None:
    guard, _, believes = believing(NoAnswerError("silent"))
    assert guard.clock_doubt() == ""
    believes.report = SiteReport(None, NIGHT - HOUR)
    refused(guard, "1.0 h slow")
    believes.report = NoAnswerError("silent")
    refused(guard, "1.0 h slow")
    guard, _, believes = believing(NoAnswerError("silent"))
    for hour in (-30.0, -31.0, -32.0, -33.0):
        guard.goto(*at(hour, 50.0))
        guard.stop()
    assert believes.asked == 2


def test_it_is_set_when_a_person_asks_for_it_and_read_back() -> None:
    guard, mount, believes = believing(SiteReport(ELSEWHERE, NIGHT - HOUR))
    refused(guard, "kochab mount set-clock and kochab mount set-site")
    guard.set_clock()
    assert believes.report == SiteReport(ELSEWHERE, NIGHT)
    refused(guard, "its site is 48, -8")
    guard.set_site()
    guard.goto(*at(-30.0, 50.0))
    assert [entry.action for entry in guard.log.sent()] == ["set its clock", "set its site", "goto"]
    guard, mount, believes = believing(SiteReport(None, NIGHT - HOUR))
    mount.set_clock = lambda now: None
    with pytest.raises(RefusedError, match="did not take it"):
        guard.set_clock()
    guard.site = None
    with pytest.raises(RefusedError, match="set your site first"):
        guard.set_site()


def test_two_commands_are_joined_in_the_person_s_language(request) -> None:
    request.addfinalizer(speak)
    guard, _, _ = believing(SiteReport(ELSEWHERE, NIGHT - HOUR))
    speak(lambda text, note, n: " und " if text == " and " else text)
    assert "kochab mount set-clock und kochab mount set-site" in guard.clock_doubt()


def shifted():
    """A guard whose mount has moved its position by 15 degrees of right ascension with its new clock."""
    guard, mount, _ = believing(SiteReport(None, NIGHT - HOUR))
    guard._reopen = lambda: setattr(mount, "closed", False) or mount
    take = mount.set_clock

    def shifting(now):
        take(now)
        mount.here = ((mount.here[0] + 15.0) % 360.0, mount.here[1])

    mount.set_clock = shifting
    guard.set_clock()
    return guard, mount


def not_slewing(guard):
    with pytest.raises(RefusedError, match=r"shifted by 11.5° with its new clock or site. Sync on a solved frame"):
        guard.goto(*at(-30.0, 50.0))


def by_hand(guard):
    guard.sync(*at(-38.0, 41.0), by_hand=True, confirmed=True)


@pytest.mark.parametrize("settled", [by_hand, lambda guard: guard.clock_and_site.trust()])
def test_a_mount_that_shifts_with_its_clock_is_synced_before_it_slews(settled) -> None:
    """Synced on the old clock, it would go 15 degrees aside."""
    guard, mount = shifted()
    not_slewing(guard)
    assert not mount.did
    settled(guard)
    guard.goto(*at(-30.0, 50.0))


def test_a_mount_whose_position_is_lost_does_not_park_by_it_and_may_go_home() -> None:
    guard, mount = shifted()
    with pytest.raises(RefusedError, match="Sync on a solved frame"):
        run(guard.rest("park"))
    assert not mount.did
    guard.go_home()
    assert [name for name, *_ in mount.did] == ["home"]


def test_a_position_that_is_lost_is_not_found_by_a_new_line_nor_by_a_site_typed_again() -> None:
    guard, _ = shifted()
    guard.reconnect()
    not_slewing(guard)
    guard.site = SITE
    not_slewing(guard)


def test_who_takes_the_sync_back_that_found_a_lost_position_has_lost_it_again() -> None:
    guard, _ = shifted()
    by_hand(guard)
    guard.undo_sync()
    not_slewing(guard)
    assert not guard.can_undo


@pytest.mark.parametrize(
    "loses",
    [
        lambda guard, mount: guard.reconnect(),
        lambda guard, mount: guard.set_clock(),
        lambda guard, mount: guard.set_site(),
        lambda guard, mount: setattr(mount, "here", at(-40.0, 90.0)),
    ],
    ids=["new line", "clock", "site", "switched off and on"],
)
def test_a_sync_that_the_mount_may_no_longer_hold_is_not_taken_back(loses) -> None:
    """Undo would shift its position by what it never had."""
    guard, mount, _ = believing(SiteReport(SITE, NIGHT))
    guard._reopen = lambda: setattr(mount, "closed", False) or mount
    by_hand(guard)
    loses(guard, mount)
    before = list(mount.did)
    with pytest.raises(RefusedError, match="No sync to undo"):
        guard.undo_sync()
    assert mount.did == before


@pytest.mark.parametrize(
    "silent", [lambda guard, mount: setattr(mount, "missed", 1), lambda guard, mount: guard.reconnect()]
)
@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"time_utc": datetime(2013, 1, 1, tzinfo=UTC)}, "its clock is 2013-01-01 00:00"),
        ({"time_utc": NIGHT - timedelta(seconds=60.0)}, "its clock is 2026-01-15 21:59"),  # as OnStepX wakes
        ({"site": Site(48.0, -8.0)}, "its site is"),
        ({"last_start": "1"}, "it tells of a new start"),
        ({}, ""),
    ],
)
def test_after_a_silence_a_mount_that_tells_otherwise_than_before_was_restarted(changed, told, silent) -> None:
    """Even where its clock is still near the computer's."""
    guard, mount, believes = believing(SiteReport(SITE, NIGHT, last_start=""))
    guard._reopen = lambda: setattr(mount, "closed", False) or mount
    assert guard.preview_goto(*at(-30.0, 50.0)).allowed
    believes.report = replace(believes.report, **changed)
    assert guard.preview_goto(*at(-30.0, 50.0)).allowed, "it is not asked again while it answers everything"
    silent(guard, mount)
    refusals = " ".join(guard.preview_goto(*at(-30.0, 50.0)).refusals)
    assert ("Mount was restarted" in guard.policy.slew_block_reason) is bool(told)
    assert told in guard.policy.slew_block_reason
    assert bool(refusals) is bool(told)


def test_a_clock_that_a_person_has_set_here_is_no_restart() -> None:
    guard, mount, believes = believing(SiteReport(SITE, NIGHT - HOUR))
    guard.clock_doubt()
    guard.set_clock()
    mount.missed += 1
    assert guard.preview_goto(*at(-30.0, 50.0)).allowed
    mount.missed += 1
    believes.report = SiteReport(SITE, NIGHT - HOUR)
    guard.set_clock()  # the clock of before is asked for first: afterwards it tells nothing
    assert "Mount was restarted" in guard.policy.slew_block_reason


def test_a_mount_without_an_answer_for_its_clock_is_not_asked_without_end() -> None:
    guard, mount, believes = believing(NoAnswerError("It knows no such question."))
    for _ in range(9):
        mount.missed += 1
        guard.preview_goto(*at(-30.0, 50.0))
    assert believes.asked == 2


def test_a_moving_mount_keeps_its_clock() -> None:
    guard, mount, _ = believing(SiteReport(None, NIGHT - HOUR))
    mount.slew_deg_s = 1.0
    guard.clock_and_site.trust()
    guard.goto(*at(-30.0, 50.0))
    with pytest.raises(RefusedError, match="moving"):
        guard.set_clock()


def test_where_it_cannot_be_set_the_hand_control_is_named() -> None:
    guard, mount, _ = believing(SiteReport(None, NIGHT - HOUR))
    mount.lacks = {Ability.SET_CLOCK: "It has no command for it."}
    refused(guard, "on its hand control")
    with pytest.raises(RefusedError, match="no command for it"):
        guard.set_clock()


@pytest.mark.parametrize("driver", [name for name in DRIVERS if name not in SERVERS])
def test_what_a_simulated_controller_believes_is_asked_and_set_as_its_protocol_says(driver) -> None:
    """The responders were written from the protocols' documents."""
    clock = Night()
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 20.0, clock.unix)
    telescope.sync(*place(-20.0, 40.0, clock))
    responder = open_any(driver, telescope)
    line = own_line(responder)
    try:
        mount = opened(driver, line.port, clock)
        guard = Guard(mount, SITE, LIMITS, clock=clock)
        target = place(-30.0, 50.0, clock)
        telescope.log.clear()
        if driver in (*COUNTERS, "rainbow"):
            with pytest.raises(RefusedError, match=r"neither site nor time|Rainbow.* has no command to set its clock"):
                guard.set_clock()
            assert guard.clock_doubt() == ""
            mount.close()
            return
        believes = responder.settings
        believes.clock_error, believes.latitude_deg, believes.longitude_deg = -2.0 * HOUR, -33.25, -70.5
        with pytest.raises(RefusedError, match=r"clock is 2.0 h slow .* site is -33.25, -70.5"):
            guard.goto(*target)
        assert not moved(telescope)
        if driver in ("nexstar", "starsense", "synscan"):
            with pytest.raises(RefusedError, match="aligned on stars"):
                guard.set_clock()
            telescope.aligned = False
        if driver == "astrophysics":
            with pytest.raises(RefusedError, match=r"Astro.* has no command to set its clock"):
                guard.set_clock()
            mount.close()
            return
        guard.set_clock()
        assert abs((believes.utc() - clock()).total_seconds()) < 3.0
        guard.set_site()
        there = believes.latitude_deg, believes.longitude_deg
        assert there == pytest.approx((SITE.latitude_deg, SITE.longitude_deg), abs=0.01)
        telescope.aligned = True
        run(guard.slew(*target))
        for zone in (timezone(-5 * HOUR), timezone(13 * HOUR), UTC):
            telescope.aligned = driver not in ("nexstar", "starsense", "synscan")
            mount.set_clock(clock().astimezone(zone))
            assert abs((believes.utc() - clock()).total_seconds()) < 3.0
            assert timedelta(hours=believes.utc_offset_h) == zone.utcoffset(None)
        for site in (Site(-33.9, 151.2), Site(64.1, -21.9), Site(-0.2, -0.3)):
            mount.set_site(site)
            told = believes.latitude_deg, believes.longitude_deg
            assert told == pytest.approx((site.latitude_deg, site.longitude_deg), abs=0.01)
        mount.close()
    finally:
        line.stop()


def test_a_zone_that_is_no_whole_hour_is_sent_as_universal_time(monkeypatch) -> None:
    class India(datetime):
        def astimezone(self, tz=None):
            return datetime.astimezone(self, tz or timezone(5.5 * HOUR))

    now = India(2026, 1, 15, 22, 0, tzinfo=UTC)
    assert (wall_clock(now), wall_clock(now).utcoffset()) == (now, timedelta())


def test_clock_and_site_behind_an_alpaca_server(tmp_path) -> None:
    with alpaca(tmp_path) as bench:
        device = bench.device
        device.get_utcdate = lambda: f"{bench.clock() - HOUR:%Y-%m-%dT%H:%M:%S}Z"
        sent = []
        device.put_utcdate = lambda UTCDate: sent.append(UTCDate)
        guard = Guard(bench.open(), SITE, LIMITS, clock=bench.clock)
        with pytest.raises(RefusedError, match=r"1.0 h slow"):
            guard.goto(*place(-30.0, 50.0, bench.clock))
        assert not moved(bench.telescope)
        with pytest.raises(RefusedError, match="did not take it"):
            guard.set_clock()
        assert (
            abs((datetime.fromisoformat(sent[0].rstrip("Z")).replace(tzinfo=UTC) - bench.clock()).total_seconds()) < 5
        )
        guard.close()


# -- as real mounts answer, see ../shared/mount-transcripts.md ---------------------------------

NOON = datetime(2026, 9, 26, 1, 0, tzinfo=UTC).astimezone(timezone(2 * HOUR))


def test_l06_a_meade_tells_in_two_texts_that_it_reckons_the_planets() -> None:
    script = [*GPS_START, (b":GW#", b"PN0#"), (b":SG-02#", b"1"), (b":SL03:00:00#", b"1")]
    script += [(b":SC09/26/26#", b"1Updating Planetary Data#" + b" " * 32 + b"#"), (b":GR#", b"05:30:00#")]
    with transcript(Lx200, [*script, (b":GD#", b"-12\xdf15:00#")]) as mount:
        taken = mount.talk.link.buffer
        mount.talk.link.discard = lambda quiet_s=0.0: taken.clear() or b""
        mount.set_clock(NOON)
        assert mount.position().ra_deg == 82.5


def test_l2a_an_onstep_answers_the_date_with_one_byte() -> None:
    script = [
        (b":GVP#", b"On-Step#"),
        (b":GVN#", b"4.24g#"),
        (b":GR#", b"05:30:00#"),
        (b":SG-02#", b"1"),
        (b":SL03:00:00#", b"1"),
    ]
    site = [(b":St+40*52#", b"1"), (b":Sg345*34#", b"1")]
    with transcript(OnStep, [*script, (b":SC09/26/26#", b"1"), *site]) as mount:
        mount.set_clock(NOON)
        mount.set_site(Site(40.8728, 14.4377))


def test_nothing_is_set_that_nobody_asked_for() -> None:
    for driver in DRIVERS:
        if driver in SERVERS:
            continue
        clock = Night()
        telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 20.0, clock.unix)
        telescope.sync(*place(-20.0, 40.0, clock))
        responder = open_any(driver, telescope)
        line = own_line(responder)
        mount = opened(driver, line.port, clock)
        guard = Guard(mount, SITE, Limits(crosses_meridian=True), clock=clock)
        before = responder.settings.__dict__.copy() if driver not in COUNTERS else {}
        guard.sync(*guard.to_mount(*guard.position_icrs()), by_hand=True, confirmed=True)
        run(guard.slew(*place(-30.0, 50.0, clock)))
        guard.epoch_doubt(), guard.clock_doubt()
        guard.close()
        line.stop()
        assert (responder.settings.__dict__ if driver not in COUNTERS else {}) == before, driver


@pytest.mark.parametrize(("lag_s", "restarted", "told"), [(1.0, True, True), (1.0, False, False), (0.0, True, False)])
def test_a_restarted_mount_behind_a_server_is_told_time_and_place_before_it_is_trusted(lag_s, restarted, told) -> None:
    """An M-Uno put home and vouched for went 107 deg wrong, to 18 deg below the horizon: its sidereal time was 0 h."""
    guard, mount = guarded()
    mount.lag_s = lag_s
    mount.set_site = lambda site: mount._do("set_site", site)
    mount.set_clock = lambda now: mount._do("set_clock", now)
    if restarted:
        guard.supervisor.restarted("Mount was restarted.")
    guard.clock_and_site.trust()
    assert [name for name, *_ in mount.did] == (["set_site", "set_clock"] if told else [])
    guard.goto(*at(-41.0, 40.0))


def test_what_could_not_be_told_is_not_trusted() -> None:
    guard, mount = guarded()
    mount.lag_s, mount.fails = 1.0, {"set_site": NoAnswerError("The mount does not answer.")}
    mount.set_site = lambda site: mount._do("set_site", site)
    guard.supervisor.restarted("Mount was restarted.")
    with pytest.raises(NoAnswerError):
        guard.clock_and_site.trust()
    with pytest.raises(RefusedError, match="was restarted"):
        guard.goto(*at(-41.0, 40.0))
