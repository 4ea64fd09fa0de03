"""Targets by name and by coordinates, and standing still."""

from dataclasses import replace
from datetime import UTC, datetime

import erfa
import numpy as np
import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError, RefusedError, StrayedError, UsageError
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.workflows.goto_target import goto_target, named_target, settled, target_at, with_retries
from tests.workflows.mount_nights import bench, good, target_of
from tests.workflows.rig_mount import SILENT

NIGHT = datetime(2026, 1, 15, tzinfo=UTC)


@pytest.mark.parametrize(
    ("name", "ra", "dec"),
    [
        ("Vega", 279.236, 38.786),
        ("HIP 91262", 279.236, 38.786),
        ("alpha Lyrae", 279.236, 38.786),
        ("M 42", 83.82, -5.39),
        ("NGC 7000", 314.821, 44.529),
    ],
)
def test_names(name, ra, dec) -> None:
    target = named_target(name, NIGHT)
    assert (target.ra_deg, target.dec_deg) == (pytest.approx(ra, abs=0.05), pytest.approx(dec, abs=0.05))
    assert target.name == name


def test_proper_motion_is_applied() -> None:
    then, now = (named_target("HIP 87937", datetime(y, 1, 1, tzinfo=UTC)) for y in (2000, 2026))
    assert (now.dec_deg - then.dec_deg) * 3600.0 == pytest.approx(26 * 10.33, rel=0.01)  # Barnard's


def test_planets_are_where_erfa_has_them_and_the_moon_where_one_stands() -> None:
    jd = 2440587.5, NIGHT.timestamp() / 86400.0
    for number, name in ((2, "Venus"), (5, "Jupiter"), (6, "saturn")):
        from_earth = erfa.plan94(*jd, number)["p"] - erfa.epv00(*jd)[0]["p"]
        ra, dec = np.degrees(erfa.c2s(from_earth))
        found = named_target(name, NIGHT)
        assert apart_deg((found.ra_deg, found.dec_deg), (ra, dec)) < 0.03  # light takes half an hour, a planet 1'
    moon = [named_target("Moon", NIGHT, site) for site in (None, Site(50.0, 8.0))]
    assert 0.1 < apart_deg(*((one.ra_deg, one.dec_deg) for one in moon)) < 1.1  # the parallax


def test_nothing_moves_towards_a_guess() -> None:
    with pytest.raises(UsageError, match="Did you mean 433 Eros"):
        named_target("433", NIGHT)


def test_what_nothing_is_called_and_what_is_no_place() -> None:
    with pytest.raises(UsageError, match="is called"):
        named_target("no such star", NIGHT)
    with pytest.raises(UsageError, match="not a valid position"):
        target_at(10.0, 91.0)
    assert target_at(-10.0, 5.0).ra_deg == 350.0


def test_a_goto_ends_at_rest() -> None:
    b = bench(good(lost_deg=0.0))
    target = target_of(b)
    run(goto_target(b.guard, target, b.wait))
    assert not b.rig.mount.slewing
    assert b.off_arcsec(target) < 120.0  # refraction, which the mount does not know


def test_a_goto_into_the_ground_is_refused() -> None:
    b = bench()
    with pytest.raises(RefusedError, match="limit"):
        run(goto_target(b.guard, target_of(b, 0.0, -70.0), b.wait))
    assert b.mount.did == []


def test_settled_waits_for_a_slew_that_somebody_else_began() -> None:
    b = bench(good(lost_deg=0.0))
    ra, dec = b.rig.mount.believed_deg()
    b.rig.mount.goto(ra - 20.0, dec)
    run(settled(b.guard, b.wait))
    assert not b.rig.mount.slewing


@pytest.mark.parametrize("settle_s", [0.0, 3.0, 7.0])
def test_vibrations_have_their_time_to_die_once_the_mount_stands(settle_s) -> None:
    b, waits = bench(good(lost_deg=0.0)), []
    ra, dec = b.rig.mount.believed_deg()
    b.rig.mount.goto(ra - 5.0, dec)

    def wait(seconds):
        waits.append((seconds, b.rig.mount.slewing))
        b.wait(seconds)

    run(settled(b.guard, wait) if settle_s == 3.0 else settled(b.guard, wait, settle_s))  # 3 s unless told
    assert waits[-1] == (settle_s, False)
    assert waits[0][1]


def test_a_mount_that_never_rests_is_said() -> None:
    b = bench(good(lost_deg=0.0))
    from kochab.core.mount import Direction

    b.rig.mount.move(Direction.EAST, 0.02)
    with pytest.raises(NoAnswerError, match="not stop moving"):
        run(settled(b.guard, b.wait))
    assert b.mount.did == [("stop",)]


def test_a_mount_that_runs_away_and_says_that_it_stands_is_stopped() -> None:
    b = bench(good(lost_deg=0.0))
    from kochab.core.mount import Direction

    b.rig.mount.move(Direction.EAST, 2.0)
    told = b.mount.state
    b.mount.state = lambda: replace(told(), slewing=False)
    with pytest.raises(StrayedError, match="kept moving"):
        run(settled(b.guard, b.wait))
    assert b.mount.did == [("stop",)]
    b.rig.clock.step(3.0)
    assert not b.rig.mount.slewing


def test_a_question_is_asked_again_but_not_for_ever() -> None:
    answers = [SILENT, SILENT, 7]

    def ask():
        value = answers.pop(0)
        if isinstance(value, Exception):
            raise value
        return value

    assert with_retries(ask) == 7
    answers += [SILENT] * 3
    with pytest.raises(NoAnswerError):
        with_retries(ask)
