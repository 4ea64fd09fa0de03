"""The Solar System of 1900 to 2050 against the Swiss Ephemeris, which rests on JPL's DE431 (Koch and Treindl)."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from kochab.core.attitude import unit
from kochab.core.progress import run
from kochab.sky.apparent import julian_date_tt
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.orbits import carried
from kochab.sky.small_bodies import shipped_small_bodies
from kochab.sky.solar_system import major_bodies, observer_at

SWISS = json.loads(Path(__file__).with_name("swiss.json").read_text(encoding="utf-8"))


def moment(jd):
    return datetime(2000, 1, 1, 12, tzinfo=UTC) + timedelta(days=jd - 2451545.0)


def arcsec(ours, theirs):
    return np.degrees(np.linalg.norm(unit(ours) - unit(theirs), axis=1)) * 3600


@pytest.mark.parametrize("name", SWISS["planets"])
def test_planets_and_the_moon_of_a_century_and_a_half(name):
    rows, ephemeris = np.array(SWISS["planets"][name]), shipped_ephemeris()
    jd = rows[:, 0]
    assert arcsec(ephemeris(name, jd) - ephemeris("earth", jd), rows[:, 1:]).max() < 0.4
    assert jd.min() < 2416000.0


@pytest.fixture(scope="module")
def asteroids():
    """Errors over their sigma (years, asteroids) and the names; all are carried together, which costs as much as one."""
    names, ephemeris, table = list(SWISS["asteroids"]), shipped_ephemeris(), shipped_small_bodies()
    at, shares = [table.names.index(name) for name in names], []
    dates = {
        float(rows[0][0]): np.array(rows) for rows in zip(*(SWISS["asteroids"][name] for name in names), strict=True)
    }
    begun = table.epoch_jd[at]
    for side in (
        sorted(jd for jd in dates if jd > begun[0]),
        sorted((jd for jd in dates if jd < begun[0]), reverse=True),
    ):
        state, since = table.state[at], begun
        for jd in side:  # each from the one before it: from the elements' own date all would be four times as far
            state, since = run(carried(state, since, jd, ephemeris)), np.full(len(at), jd)
            earth = ephemeris("earth", np.array([jd])) - ephemeris("sun", np.array([jd]))
            assert (dates[jd][:, 0] == jd).all()
            shares.append(arcsec(state[:, :3] - earth, dates[jd][:, 1:] - earth) / table.sigma_arcsec(jd)[at])
    assert len(shares) == len(dates)
    return np.array(shares), names


@pytest.mark.parametrize("name", SWISS["asteroids"])
def test_the_sigma_of_asteroids_grows_as_their_error_does(asteroids, name):
    shares, names = asteroids
    assert shares[:, names.index(name)].max() < 2.0


@pytest.mark.parametrize(("jd", "delta_t_s"), SWISS["delta_t"])
def test_the_time_of_the_planets_runs_ahead_of_the_clock_as_it_did(jd, delta_t_s):
    """UTC since 1972 keeps within 0.9 s of UT1; before, a second is half an arcsecond of the Moon."""
    off_s = (julian_date_tt(moment(jd)) - jd) * 86400.0 - delta_t_s
    assert abs(off_s) < 1.2


@pytest.mark.parametrize(("jd", "phase_deg", "v"), [row for row in SWISS["moon"] if row[1] < 172.0])
def test_the_moon_is_as_bright_as_its_phase(jd, phase_deg, v):
    """The crescent, too: on a day after New Moon it is two magnitudes fainter than the formula for larger phases has."""
    moon = next(body for body in major_bodies(observer_at(moment(jd), None)) if body.name == "Moon")
    assert moon.magnitude == pytest.approx(v, abs=0.25)
