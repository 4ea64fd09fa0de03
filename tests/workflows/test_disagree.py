"""The detective with a mount: a clock an hour ahead is found out, frames and all."""

from dataclasses import replace
from datetime import timedelta

import pytest

from kochab.core.attitude import apart_deg, attitude_from
from kochab.core.camera import Camera
from kochab.core.errors import NoAnswerError
from kochab.core.mount import SiteReport
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.workflows.recover_mount import sighted, why_they_disagree
from tests.polar.displaced import displaced, solution
from tests.workflows.mount_nights import SITE, bench, good


def test_a_mount_whose_clock_is_an_hour_ahead() -> None:
    config = good(lost_deg=0.0)
    b = bench(replace(config, mount=replace(config.mount, computer_clock_s=3600.0)))
    ra, dec = b.rig.truth().of_date_deg
    b.rig.mount.sync((ra + 15.041) % 360.0, dec)  # aligned on its own time
    b.mount.site_report = lambda: SiteReport(SITE, b.guard.clock() + timedelta(hours=1))
    found, seen = run(why_they_disagree(b.guard, b.solve_now))
    assert found.cause == "summer time"
    assert found.suspects[0].score > 0.95
    assert len(seen) == 1


def test_mount_and_sky_agree() -> None:
    b = bench(good(lost_deg=0.0))
    found, _ = run(why_they_disagree(b.guard, b.solve_now))
    assert found.agrees


def test_a_lost_mount_is_given_no_cause() -> None:
    b = bench(good(lost_deg=2.5))
    found, _ = run(why_they_disagree(b.guard, b.solve_now))
    assert found.cause == ""
    assert found.offset_arcsec == pytest.approx(2.5 * 3600.0, rel=0.01)


def test_a_mount_that_does_not_tell_its_time_is_no_hindrance() -> None:
    b = bench(good(lost_deg=0.0))

    def silent():
        raise NoAnswerError("It does not say.")

    b.mount.site_report = silent
    solved = run(b.solve_now())
    assert sighted(b.guard, solved).beliefs == SiteReport()


@pytest.mark.parametrize("alt_azimuth", [True, False, None])
def test_a_sighting_has_how_the_mount_stands(alt_azimuth) -> None:
    b = bench(good(lost_deg=0.0))
    state = b.mount.state()
    b.mount.state = lambda: replace(state, alt_azimuth=alt_azimuth)
    assert sighted(b.guard, run(b.solve_now())).alt_azimuth is alt_azimuth


def test_the_mounts_clock_is_carried_to_the_time_of_the_frame() -> None:
    b = bench(good(lost_deg=0.0))
    b.mount.site_report = lambda: SiteReport(SITE, b.guard.clock())
    then = b.guard.clock() - timedelta(minutes=30)
    told = sighted(b.guard, run(b.solve_now()), then).beliefs
    assert abs((told.time_utc - then).total_seconds()) < 5.0


def test_the_place_on_the_sky_does_not_move_with_the_fitted_optical_centre() -> None:
    """A frame's place is its middle: the optical axis of this fit moves by 15 arcmin."""
    b = bench(good(lost_deg=0.0))
    camera = Camera(2256, 1504, 48925.0, 1180.0, 720.0, k1=4.1)
    found = solution(camera, attitude_from(40.0, 75.0, 20.0).matrix)
    moved, _ = displaced(found, 180.0, -130.0)
    right, other = (sighted(b.guard, s).sky_deg for s in (found, moved))
    assert apart_deg(right, other) * 3600.0 < 0.5
    assert apart_deg(found.attitude.ra_dec_deg, moved.attitude.ra_dec_deg) * 3600.0 > 900.0


def test_no_solution_is_passed_on() -> None:
    b = bench()
    nothing = NoSolution(Reason.TOO_FEW_STARS, "Expose longer.")

    def blind():
        return nothing
        yield

    assert run(why_they_disagree(b.guard, blind)) is nothing
