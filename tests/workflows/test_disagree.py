"""The detective with a mount: a clock an hour ahead is found out, frames and all."""

from dataclasses import replace
from datetime import timedelta

import pytest

from app.core.errors import NoAnswerError
from app.core.progress import run
from app.core.solution import NoSolution, Reason
from app.mounts.beliefs import Beliefs
from app.workflows.disagree import sighted, why_they_disagree
from tests.workflows.mount_nights import SITE, bench, good


def test_a_mount_whose_clock_is_an_hour_ahead() -> None:
    config = good(lost_deg=0.0)
    b = bench(replace(config, mount=replace(config.mount, computer_clock_s=3600.0)))
    ra, dec = b.rig.truth().of_date_deg
    b.rig.mount.sync((ra + 15.041) % 360.0, dec)  # aligned on its own time
    b.mount.beliefs = lambda: Beliefs(SITE, b.guard.clock() + timedelta(hours=1))
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

    b.mount.beliefs = silent
    solved = run(b.solve_now())
    assert sighted(b.guard, solved).beliefs == Beliefs()


def test_the_mounts_clock_is_carried_to_the_time_of_the_frame() -> None:
    b = bench(good(lost_deg=0.0))
    b.mount.beliefs = lambda: Beliefs(SITE, b.guard.clock())
    then = b.guard.clock() - timedelta(minutes=30)
    told = sighted(b.guard, run(b.solve_now()), then).beliefs
    assert abs((told.time_utc - then).total_seconds()) < 5.0


def test_no_solution_is_passed_on() -> None:
    b = bench()
    nothing = NoSolution(Reason.TOO_FEW_STARS, "Expose longer.")

    def blind():
        return nothing
        yield

    assert run(why_they_disagree(b.guard, blind)) is nothing
