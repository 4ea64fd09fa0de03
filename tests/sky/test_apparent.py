from datetime import UTC, datetime

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.sky.apparent import (
    aberrated,
    apparent,
    earth_velocity,
    from_apparent,
    julian_years,
    of_date_matrix,
    with_aberration,
    without_aberration,
)
from kochab.sky.horizon import sun_altitude_deg

ARCSEC_PER_RAD = np.degrees(1.0) * 3600.0
WHEN = datetime(2025, 3, 14, 21, 30, tzinfo=UTC)


def spread(n=60):
    v = np.random.default_rng(1).normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_aberration_agrees_with_astropy():
    import astropy.units as u
    from astropy.coordinates import GCRS, SkyCoord, get_sun
    from astropy.time import Time

    time = Time(WHEN)
    stars = SkyCoord(spread(), representation_type="cartesian")
    far = SkyCoord(stars.cartesian * 1e12 * u.au, frame="icrs", representation_type="cartesian")
    seen = far.transform_to(GCRS(obstime=time)).cartesian.xyz.value.T
    seen = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    # Astropy bends light at the Sun as well: 4 mas at right angles to it, more near it.
    sun = get_sun(time).cartesian.xyz.value
    away = spread() @ (sun / np.linalg.norm(sun)) < 0.5
    gap = np.linalg.norm(with_aberration(spread(), WHEN) - seen, axis=1) * ARCSEC_PER_RAD
    assert gap[away].max() < 0.02


def test_aberration_is_20_arcsec_across_the_motion():
    velocity = earth_velocity(WHEN)
    across = np.cross(velocity, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    moved = np.linalg.norm(aberrated(across[None], velocity) - across) * ARCSEC_PER_RAD
    assert 20.0 < moved < 21.0
    ahead = velocity / np.linalg.norm(velocity)
    assert aberrated(ahead[None], velocity)[0] == pytest.approx(ahead, abs=1e-12)


@given(seed=st.integers(0, 1000), day=st.integers(1, 28), month=st.integers(1, 12))
def test_aberration_comes_off_again(seed, day, month):
    when = datetime(2026, month, day, tzinfo=UTC)
    v = np.random.default_rng(seed).normal(size=(5, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    there = with_aberration(v, when)
    assert np.linalg.norm(there, axis=1) == pytest.approx(1.0, abs=1e-12)
    assert without_aberration(there, when) == pytest.approx(v, abs=1e-9)


def test_the_apparent_place_agrees_with_erfa():
    import erfa

    jd = 2400000.5 + 60748.0 + 21.5 / 24 + 69.184 / 86400
    want = []
    for v in spread(40):
        ra, dec = np.arctan2(v[1], v[0]), np.arcsin(v[2])
        ri, di, eo = erfa.atci13(ra, dec, 0, 0, 0, 0, jd, 0.0)
        want.append(unit_vectors(np.degrees(erfa.anp(ri - eo)), np.degrees(di)))
    gap = np.linalg.norm(apparent(spread(40), WHEN) - want, axis=1) * ARCSEC_PER_RAD
    assert np.median(gap) < 0.01
    assert gap.max() < 0.1  # the Sun's bending, which we leave out
    assert from_apparent(apparent(spread(40), WHEN), WHEN) == pytest.approx(spread(40), abs=1e-9)


def test_the_series_of_a_moment_are_evaluated_once_and_nobody_changes_them(monkeypatch):
    when, asked = datetime(2031, 5, 6, 21, 40, tzinfo=UTC), []
    for name in ("epv00", "pnm06a", "gst06a"):
        series = getattr(erfa, name)
        monkeypatch.setattr(erfa, name, lambda *given, name=name, series=series: asked.append(name) or series(*given))
    heights = {sun_altitude_deg(Site(50.0, 8.0), when) for _ in range(3)}
    assert len(heights) == 1
    assert sorted(asked) == ["epv00", "gst06a", "pnm06a"]
    with pytest.raises(ValueError, match="read-only"):
        of_date_matrix(when)[0, 0] = 1.0


def test_years():
    assert julian_years(datetime(2000, 1, 1, 11, 58, 55, 816000, tzinfo=UTC)) == pytest.approx(2000.0, abs=1e-9)
    assert julian_years(datetime(2024, 1, 1, tzinfo=UTC)) == pytest.approx(2024.0, abs=2e-3)
