"""Park, unpark, home and tracking rates behind the guard: watched, limited, stopped and checked."""

import re
import time
from dataclasses import replace

import pytest

from kochab.core.errors import NoAnswerError, RefusedError, StrayedError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Ability, PierSide, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts.drivers.ioptron import Ioptron
from tests.gear.mounts.bench import SITE, simulated
from tests.gear.mounts.imaginary import NOON, at, guarded
from tests.gear.mounts.scripted import transcript


def test_a_park_and_a_home_are_waited_for_and_logged() -> None:
    guard, mount = guarded(dec_deg=84.0)
    run(guard.rest("park"))
    assert mount.state().parked
    assert mount.did == [("park",)]
    guard.unpark()
    run(guard.rest("home"))
    assert mount.state().at_home
    assert [entry.action for entry in guard.log.sent()] == ["park", "unpark", "home"]
    assert not guard.emergency.moving


@pytest.mark.parametrize("action", ["park", "home"])
def test_its_preview_sends_nothing_and_tells_that_the_way_is_the_mounts_own(action) -> None:
    guard, mount = guarded()
    preview = guard.preview_rest(action)
    assert preview.allowed
    assert "in advance" in preview.warnings[0]
    assert mount.did == []


def test_a_mount_on_its_way_to_park_that_comes_below_the_horizon_limit_is_stopped() -> None:
    guard, mount = guarded(hour_angle_deg=-60.0, dec_deg=20.0)
    mount.park = lambda: mount._rest("park", at(-110.0, -10.0), parked=True)
    mount.slew_deg_s = 15.0
    guard.emergency.wait = lambda s: time.sleep(0.1)
    with pytest.raises(StrayedError, match=r"on its way to rest: .* the limit is 5°"):
        run(guard.rest("park"))
    assert mount.did[-1] == ("stop",)
    assert mount.position().dec_deg > -10.0


@pytest.mark.parametrize(("reports", "limits"), [(0.4, {}), (30.0, {"lowest_altitude_deg": 45.0})])
def test_a_park_position_that_the_mount_reports_is_reached_below_the_horizon_limit(reports, limits) -> None:
    guard, mount = guarded(hour_angle_deg=-60.0, dec_deg=50.0, horizon_deg=((0.0, 40.0),), **limits)
    low = at(-90.0, 0.5) if reports < 1.0 else at(-60.0, 17.2)  # some 0.4 and 30 deg high
    mount.park = lambda: mount._rest("park", low, parked=True)
    mount.slew_deg_s = 25.0
    guard.emergency.wait = lambda s: time.sleep(0.1)
    mount.park_altitude_deg = lambda: reports
    assert any("high: until then that is the horizon limit" in told for told in guard.preview_rest("park").warnings)
    run(guard.rest("park"))
    assert mount.state().parked
    assert mount.did == [("park",)]
    assert guard.limits.horizon_deg, "it holds again"


def test_the_drawn_horizon_holds_on_the_way_to_a_park_position_above_it() -> None:
    """Beside a roof 40 deg high the mount dips to 30 on its way to a park position at 45."""
    guard, mount = guarded(hour_angle_deg=-60.0, dec_deg=50.0, horizon_deg=((0.0, 40.0),))
    mount.park = lambda: mount._rest("park", at(-60.0, 17.2), parked=True)
    mount.slew_deg_s = 25.0
    guard.emergency.wait = lambda s: time.sleep(0.1)
    mount.park_altitude_deg = lambda: 45.0
    assert not any("that is the horizon limit" in told for told in guard.preview_rest("park").warnings)
    with pytest.raises(StrayedError, match="the limit is 40°"):
        run(guard.rest("park"))
    guard.limits = replace(guard.limits, horizon_deg=((0.0, 60.0), (180.0, 20.0)))
    assert guard.policy.rest("park", mount.position(), mount.now, 45.0)[0].limits.horizon_deg == (
        (0.0, 44.0),
        (180.0, 20.0),
    ), "no more of it is given up than the park position needs"


def test_a_park_position_below_the_horizon_is_refused_before_it_begins() -> None:
    guard, mount = guarded()
    mount.park_altitude_deg = lambda: -12.0
    with pytest.raises(RefusedError, match="park position is 12° below the horizon: set another"):
        run(guard.rest("park"))
    assert mount.did == []
    assert guard.preview_rest("home").allowed


def test_a_mount_that_does_not_report_its_park_position_is_told_of_the_limit_before() -> None:
    guard, _ = guarded()
    assert any(
        re.search(r"If Kochab stops it at the horizon limit .5°., lower the limit", told)
        for told in guard.preview_rest("park").warnings
    )


def test_no_site_no_park() -> None:
    guard, mount = guarded(site=None)
    with pytest.raises(RefusedError, match="Set the site before a park"):
        run(guard.rest("park"))
    assert mount.did == []


def test_an_ioptron_reports_its_park_position_or_nothing() -> None:
    """The example of iOptron's language 3.10, 45 deg high in the south; a simulated one parks at the pole."""
    begins = (b":MountInfo#", b"0040")
    with transcript(Ioptron, [begins, (b":GPC#", b"16200000064800000#")]) as mount:
        assert mount.park_altitude_deg() == 45.0
    with transcript(Ioptron, [begins, (b":GPC#", b"")]) as mount:
        assert mount.park_altitude_deg() is None
    with simulated("ioptron") as bench:
        mount = bench.open()
        assert mount.park_altitude_deg() == pytest.approx(SITE.latitude_deg, abs=1e-4)
        mount.close()


def test_a_mount_that_stands_before_it_is_parked_has_not_parked() -> None:
    guard, mount = guarded()
    mount.park = lambda: mount._do("park")
    with pytest.raises(RefusedError, match="stopped before it was parked"):
        run(guard.rest("park"))
    assert mount.did == [("park",), ("stop",)]


def test_a_restarted_mount_that_stands_before_it_is_at_home_says_so(monkeypatch) -> None:
    """Its power failed before, and most likely again."""
    guard, mount = guarded()
    mount.now = replace(mount.now, at_home=False)
    mount.go_home = lambda: mount._do("home")
    guard.supervisor.restarted("Mount was restarted.")
    with pytest.raises(RefusedError, match=r"stopped before it was at home\. Mount was restarted\."):
        run(guard.rest("home"))


def test_a_mount_that_reports_no_home_is_there_when_it_stands_still() -> None:
    guard, mount = guarded()
    mount.now = replace(mount.now, at_home=None)
    mount.go_home = lambda: mount._do("home")
    run(guard.rest("home"))
    assert mount.did == [("home",)]


def test_a_mount_that_is_silent_on_its_way_is_stopped() -> None:
    guard, mount = guarded()

    def silent():
        raise NoAnswerError("The mount does not answer.")

    mount.park = lambda: setattr(mount, "state", silent)
    with pytest.raises(NoAnswerError):
        run(guard.rest("park"))
    assert mount.did == [("stop",)]


def test_a_mount_that_stays_parked_is_not_unparked() -> None:
    guard, mount = guarded()
    mount.now = replace(mount.now, parked=True)
    mount.unpark = lambda: None
    with pytest.raises(RefusedError, match="still reports that it is parked"):
        guard.unpark()


@pytest.mark.parametrize(
    ("rate", "arcsec_s"),
    [
        (TrackingRate.SIDEREAL, 15.041067),
        (TrackingRate.LUNAR, 14.492),
        (TrackingRate.SOLAR, 15.0),
        (TrackingRate.KING, 15.0369),
        (TrackingRate.OFF, 0.0),
    ],
)
def test_a_rate_is_sent_where_the_mount_has_it(rate, arcsec_s) -> None:
    guard, mount = guarded()
    guard.track(rate)
    assert mount.did == [("track", rate)]
    assert rate.deg_s * 3600.0 == pytest.approx(arcsec_s, abs=1e-3)
    assert rate.deg_s <= SIDEREAL_DEG_S
    mount.lacks = {rate.ability: "It cannot."}
    with pytest.raises(RefusedError, match="It cannot"):
        guard.track(rate)


@pytest.mark.parametrize(
    ("ability", "order"),
    [
        (Ability.PARK, lambda guard: guard.park()),
        (Ability.UNPARK, lambda guard: guard.unpark()),
        (Ability.HOME, lambda guard: guard.go_home()),
    ],
)
def test_what_it_lacks_is_not_sent(ability, order) -> None:
    guard, mount = guarded()
    mount.lacks = {ability: "It cannot."}
    with pytest.raises(RefusedError, match="It cannot"):
        order(guard)
    assert mount.did == []


@pytest.mark.parametrize(
    ("side", "fork", "refused"),
    [(PierSide.EAST, False, True), (PierSide.EAST, True, True), (PierSide.WEST, False, False), (None, False, False)],
)
@pytest.mark.parametrize("action", ["home", "park"])
def test_a_way_home_past_the_sun_is_refused_before_it_begins(action, side, fork, refused) -> None:
    """A mount that stopped answering on its way came within 22 deg of the Sun. Where a fork rests is not known."""
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=-5.0, time_utc=NOON, crosses_meridian=fork)
    mount.now = replace(mount.now, pier_side=side)
    told = " ".join(guard.preview_rest(action).refusals)
    assert ("deg from the Sun" in told) is (refused and action == "home")
    mount.now = replace(mount.now, alt_azimuth=True)
    assert guard.preview_rest(action).allowed
    if fork:
        other, _ = guarded(hour_angle_deg=-40.0, dec_deg=-5.0, time_utc=NOON, crosses_meridian=True)
        assert other.preview_rest(action).allowed


def test_south_of_the_equator_home_is_at_the_southern_pole() -> None:
    """The Sun of June stands in the north there: the way from beside it to the other pole would lead through it."""
    guard, mount = guarded(hour_angle_deg=0.0, dec_deg=-12.0, time_utc=NOON, site=Site(-35.0, SITE.longitude_deg))
    mount.now = replace(mount.now, pier_side=PierSide.EAST)
    assert guard.preview_rest("home").allowed
