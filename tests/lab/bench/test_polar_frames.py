"""The rendered rows of the polar bench: a sky that nothing of the polar room made, and goals that can fail."""

from dataclasses import replace
from datetime import UTC, datetime

import erfa
import numpy as np
import pytest

from kochab.core.attitude import ARCSEC, angle_between
from kochab.core.frame import Site
from kochab.lab.bench import polar_frames as bench
from kochab.sky.horizon import Refraction

SITE, AIR = Site(47.0, 8.0, 500.0), Refraction(960.0, 12.0)


@pytest.mark.parametrize(("zenith_deg", "within_arcsec"), [(20.0, 0.01), (60.0, 0.05), (75.0, 0.1), (80.0, 1.0)])
def test_the_traced_ray_is_refracted_as_erfa_says(zenith_deg, within_arcsec):
    """Beyond 80 deg ERFA's own page gives its two terms up."""
    zenith = np.radians(zenith_deg)
    a, b = erfa.refco(960.0, 12.0, 0.5, 0.55)
    traced = bench.refraction(np.array([zenith]), SITE, AIR)[0]
    assert traced == pytest.approx(a * np.tan(zenith) + b * np.tan(zenith) ** 3, abs=within_arcsec * ARCSEC)


def test_the_horizon_lifts_the_sun_by_more_than_half_a_degree():
    """29 to 36 arcmin in every almanac, where two terms give nonsense."""
    standard = bench.refraction(np.radians([89.9]), Site(45.0, 0.0, 0.0), Refraction(1010.0, 10.0))[0]
    assert 29.0 < standard / ARCSEC / 60.0 < 36.0


def test_stars_are_where_erfa_observes_them():
    night = replace(bench.night(np.random.default_rng(1), 8.0), site=SITE, air=AIR)
    unix_s = float(night.times_unix[0])
    above = bench.Overhead(night, unix_s)
    day = erfa.dtf2d("UTC", *datetime.fromtimestamp(unix_s, UTC).timetuple()[:6])
    for altitude in (20.0, 50.0, 80.0):
        level, up = np.cos(np.radians(altitude)), np.sin(np.radians(altitude))
        star = above.towards(np.array([level * 0.6, level * 0.8, up]))
        place = np.radians([SITE.longitude_deg, SITE.latitude_deg])
        air = (960.0, 12.0, 0.5, 0.55)
        azimuth, zenith, *_ = erfa.atco13(*erfa.c2s(star), 0, 0, 0, 0, *day, 0.0, *place, 500.0, 0.0, 0.0, *air)
        observed = erfa.s2c(np.pi / 2.0 - azimuth, np.pi / 2.0 - zenith)
        # a whole second of time is all that the calendar tells, 15 arcsec
        assert angle_between(above.seen(star[None])[0], observed) < (0.1 + 15.1 * (unix_s % 1.0)) * ARCSEC


def low_night():
    seeds = (np.random.default_rng([3, seed]) for seed in range(200))
    return next((n, rng) for rng in seeds if (n := bench.night(rng, 8.0)).lowest_deg < 20 and len(n.times_unix) < 5)


def test_a_low_frame_gives_the_axis_and_would_not_without_refraction():
    night, rng = low_night()
    state = rng.bit_generator.state
    found, unsolved = bench.measured(night, rng)
    assert unsolved == 0
    assert angle_between(found.error.axis, night.axis) < 20.0 * ARCSEC
    rng.bit_generator.state = state
    # the same frames, but the program is told of no air
    pictures = [bench.picture(night, number, rng) for number in range(len(night.times_unix))]
    frames = iter(pictures)
    blind = replace(night, air=Refraction(0.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "picture", lambda *_: next(frames))
        wrong, _ = bench.measured(blind, rng)
    assert angle_between(wrong.error.axis, night.axis) > 30.0 * ARCSEC


def test_a_run_repeats():
    first, again = bench.measure_frames(15.0, 1), bench.measure_frames(15.0, 1)
    assert first | {"cpu_s": 0.0} == again | {"cpu_s": 0.0}
    assert first["off_arcsec"] < 20.0
    assert 15.0 <= first["lowest_deg"] + 1.0 <= 77.0


def row(**changed):
    usual = {"off_arcsec": 2.0, "in_95": True, "accused": False, "field_deg": 8.0}
    return usual | changed


@pytest.mark.parametrize(
    ("changed", "every", "name"),
    [
        ({"off_arcsec": 4.0}, 1, "up to 8 deg"),
        ({"off_arcsec": 7.0, "field_deg": 15.0}, 1, "beyond 8 deg"),
        ({"off_arcsec": 21.0}, 100, "worst"),
        ({"in_95": False}, 10, "95 %"),
        ({"accused": True}, 100, "accused"),
    ],
)
def test_goals_are_judged(changed, every, name):
    good = [row(in_95=k % 20 != 1, field_deg=8.0 + 7.0 * (k % 2)) for k in range(200)]
    assert all(goal.met for goal in bench.goals(good))
    bad = [r | changed if k % every == 0 else r for k, r in enumerate(good)]
    if every == 1:
        bad[-1] = good[-1] | {"field_deg": 23.0 - changed.get("field_deg", 8.0)}
    failed = [goal.name for goal in bench.goals(bad) if not goal.met]
    assert len(failed) == 1
    assert name in failed[0]
