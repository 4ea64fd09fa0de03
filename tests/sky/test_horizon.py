"""Refraction near the horizon, against the classic table of mean refraction, as Allen's *Astrophysical Quantities* has it."""

from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.sky.horizon import NO_AIR, Horizon, Refraction, air_masses

SITE, WHEN = Site(47.0, 8.0, 0.0), datetime(2026, 11, 24, 20, tzinfo=UTC)
ALLEN = ((0.0, 35.35), (1.0, 24.75), (2.0, 18.4), (3.0, 14.4), (4.0, 11.72), (5.0, 9.9), (7.0, 7.4), (10.0, 5.32))
"""Apparent altitude, deg, and refraction, arcmin, at 10 C and 1013 hPa."""


def at(altitudes_deg):
    altitude, azimuth = np.radians(altitudes_deg), np.linspace(0.1, 6.0, len(altitudes_deg))
    level = np.cos(altitude)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(altitude)], axis=-1)


def altitudes_deg(directions):
    return np.degrees(np.arcsin(directions[:, 2]))


@pytest.mark.parametrize(("seen_deg", "arcmin"), ALLEN)
def test_the_air_lifts_a_low_star_as_the_table_has_it(seen_deg, arcmin):
    star = Horizon(SITE, WHEN).catalogue(at([seen_deg]))
    lifted = seen_deg - altitudes_deg(Horizon(SITE, WHEN, NO_AIR).observed(star))[0]
    assert 60.0 * lifted == pytest.approx(arcmin, abs=0.8 if seen_deg == 0.0 else 0.35)


def test_a_low_direction_comes_back_through_the_air():
    seen = at([-0.5, 0.0, 0.7, 2.0, 4.9, 5.1, 7.5, 9.9, 10.1, 30.0])
    for air in (Refraction(), Refraction(700.0, -15.0, 0.2)):
        horizon = Horizon(SITE, WHEN, air)
        gap = np.linalg.norm(horizon.observed(horizon.catalogue(seen)) - seen, axis=1)
        assert np.degrees(gap.max()) * 3600 < 0.05


def test_a_star_that_rises_is_lifted_less_and_less_and_without_a_leap():
    bare, horizon = Horizon(SITE, WHEN, NO_AIR), Horizon(SITE, WHEN)
    steps = np.arange(-0.9, 20.0, 0.05)
    lifted = altitudes_deg(horizon.observed(bare.catalogue(at(steps)))) - steps
    assert (np.diff(lifted) < 0.0).all()
    assert np.abs(np.diff(lifted)).max() * 60.0 < 0.7


def test_thin_air_lifts_less():
    high = Horizon(Site(47.0, 8.0, 3000.0), WHEN)
    star = high.catalogue(at([1.0]))
    lifted = 1.0 - altitudes_deg(Horizon(high.site, WHEN, NO_AIR).observed(star))[0]
    assert 60.0 * lifted == pytest.approx(24.6 * 0.7, abs=1.0)


@pytest.mark.parametrize(
    ("altitude_deg", "expected"),
    [(90.0, 0.9997), (60.0, 1.154), (30.0, 1.994), (10.0, 5.59), (5.0, 10.31), (0.0, 37.92), (-3.0, 37.92)],
)
def test_air_masses_are_those_of_kasten_and_young(altitude_deg, expected) -> None:
    """To three or four figures; below the horizon it is that of the horizon."""
    assert air_masses(np.array([altitude_deg])) == pytest.approx([expected], rel=1e-3)
