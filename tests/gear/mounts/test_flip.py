"""The meridian flip: a person is asked, its motion is watched, and the side of the pier is checked behind it."""

from dataclasses import replace

import pytest

from kochab.core.errors import RefusedError, StrayedError
from kochab.core.mount import PierSide
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.workflows.goto_target import FlipQuestion, flip_mount, goto_typed
from tests.gear.mounts.bench import SITE
from tests.gear.mounts.imaginary import at, guarded
from tests.gear.mounts.indi_server import indi_server
from tests.gear.mounts.test_indi import PLACE, SIMULATOR, now
from tests.gear.mounts.test_indi import at as place_now


def german(hour_angle_deg=-10.0, side=PierSide.WEST, flips=True, **limits):
    """A mount that names its side, and changes it in a slew across the meridian, or where it stands past it."""
    guard, mount = guarded(hour_angle_deg, **limits)
    mount.now = replace(mount.now, pier_side=side)
    goto = mount.goto

    def flipping(ra_deg, dec_deg):
        goto(ra_deg, dec_deg)
        if flips:
            natural = PierSide.WEST if (at(0.0, 0.0)[0] - ra_deg + 180.0) % 360.0 - 180.0 < 0.0 else PierSide.EAST
            mount.now = replace(mount.now, pier_side=natural)

    mount.goto = flipping
    return guard, mount


def typed(guard, place):
    ra, dec = from_mount_epoch(guard.position().__class__(*place, guard.epoch), guard.clock())
    return f"{ra:.5f} {dec:+.5f}"


def test_a_goto_across_the_meridian_asks_and_does_it_when_a_person_wants_it() -> None:
    guard, mount = german()
    there = typed(guard, at(40.0, 40.0))
    asked = run(goto_typed(guard, there))
    assert isinstance(asked, FlipQuestion)
    assert "west of its pier and must flip" in asked.sentence
    assert mount.did == []
    assert "reports that it reached" in run(goto_typed(guard, asked.text, flip=True))
    assert mount.now.pier_side is PierSide.EAST
    assert guard.limits.allow_flip is False, "this once"


def test_what_is_refused_for_another_reason_is_no_question() -> None:
    guard, _ = german(longest_slew_deg=30.0)
    with pytest.raises(RefusedError, match="longer than the 30"):
        run(goto_typed(guard, typed(guard, at(40.0, 40.0))))
    assert isinstance(run(goto_typed(guard, typed(guard, at(-20.0, 45.0)))), str)


def test_a_flip_that_ends_on_the_wrong_side_is_told() -> None:
    guard, mount = german(flips=False)
    with pytest.raises(RefusedError, match="THE MOUNT DID NOT FLIP: it is still west of its pier"):
        run(guard.slew(*at(40.0, 40.0), flip=True))
    assert mount.did[-1] == ("stop",)
    guard, mount = german(flips=False, allow_flip=True)
    with pytest.raises(RefusedError, match="DID NOT FLIP"):
        run(guard.slew(*at(40.0, 40.0)))


def test_either_side_will_do_near_the_meridian_and_for_a_mount_that_may_name_them_the_other_way_round() -> None:
    guard, _ = german(flips=False, allow_flip=True)
    run(guard.slew(*at(10.0, 40.0)))
    guard, _ = german(-40.0, PierSide.EAST, flips=False, allow_flip=True)
    run(guard.slew(*at(40.0, 40.0)))
    guard, mount = german(flips=False, allow_flip=True)
    mount.here = at(-10.0, 86.0)  # from afar this mount, which is there at once, would pass for a restarted one
    run(guard.slew(*at(40.0, 89.0)))  # beside the pole
    guard, _ = german(flips=False, crosses_meridian=True)
    run(guard.slew(*at(40.0, 40.0)))


def test_a_flip_where_it_stands() -> None:
    guard, mount = german(10.0)
    assert run(flip_mount(guard)) == "Flipped: the mount is east of its pier."
    assert mount.did == [("goto", *at(10.0, 40.0))]
    with pytest.raises(RefusedError, match="No flip is due: the mount is east of its pier"):
        run(flip_mount(guard))
    guard, mount = german(10.0, flips=False)
    with pytest.raises(RefusedError, match="DID NOT FLIP"):
        run(flip_mount(guard))
    for spoilt, match in (
        (german(10.0, side=None), "does not report its pier side"),
        (german(10.0, crosses_meridian=True), "needs no flip"),
        (german(-10.0), "No flip is due"),
    ):
        guard, mount = spoilt
        with pytest.raises(RefusedError, match=match):
            run(flip_mount(guard))
        assert mount.did == []


def test_a_flip_goes_over_the_pole_and_is_stopped_where_it_comes_too_low() -> None:
    guard, mount = german(40.0, side=PierSide.WEST)
    mount.slew_deg_s = 20.0
    goto = mount.goto

    def through_the_ground(ra_deg, dec_deg):
        goto(ra_deg, dec_deg)
        mount._begin(*at(100.0, -20.0), 8.0)

    mount.goto = through_the_ground
    with pytest.raises(StrayedError, match=r"off its path|the limit is 5°"):
        run(flip_mount(guard))
    assert mount.did[-1] == ("stop",)
    guard, mount = german(10.0, highest_altitude_deg=80.0)
    mount.here = at(10.0, 55.0)
    guard.limits = Limits(highest_altitude_deg=82.0)
    ends = guard.policy.goto(guard.position(), guard.state(), mount.here, flip=True)[0]
    assert len(ends.paths) == 3, "over the pole, too"


def test_tracking_that_comes_to_the_meridian_limit_names_the_flip() -> None:
    guard, mount = german(14.95)
    assert "kochab mount flip" in guard.hold_limits()
    assert mount.now.tracking is False


def test_indis_simulator_flips_where_it_is_asked_to_and_tells_its_side(tmp_path) -> None:
    with indi_server(tmp_path, "indi_simulator_telescope") as server:
        for wish in ("CONNECTION.CONNECT=On", PLACE, "TELESCOPE_PARK.UNPARK=On"):
            server.set(f"{SIMULATOR}.{wish}")
        mount = open_mount("indi", f"{server.address}/{SIMULATOR}", site=SITE, clock=now)
        with Guard(mount, SITE, Limits(crosses_meridian=True), clock=now) as guard:
            run(guard.slew(*place_now(-30.0, 60.0)))
            guard.limits = Limits()
            assert guard.state().pier_side is PierSide.WEST
            assert guard.policy.asks_flip(guard.position(), guard.state(), place_now(30.0, 60.0))
            with pytest.raises(RefusedError, match="would flip"):
                run(guard.slew(*place_now(30.0, 60.0)))
            run(guard.slew(*place_now(30.0, 60.0), flip=True))
            assert guard.state().pier_side is PierSide.EAST
