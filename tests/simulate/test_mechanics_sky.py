"""Directions over a site are those of astropy, and come back; poles and sidereal time too."""

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.simulate.night_sky import Atmosphere, LocalSky, altitude_deg, azimuth_deg

SITES = [Site(47.0, 8.0, 450.0), Site(-33.5, 151.2, 60.0), Site(2.0, -70.0, 2500.0)]
NOW = 1_720_000_000.0  # 2024-07-03: within the table of the Earth's rotation astropy brings along


def _random_vectors(count=400, seed=1):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def _astropy_altaz(vectors, site, air):
    from astropy import units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    where = EarthLocation.from_geodetic(site.longitude_deg * u.deg, site.latitude_deg * u.deg, site.height_m * u.m)
    moment = Time(NOW, format="unix", scale="utc")
    moment.delta_ut1_utc = 0.0
    frame = AltAz(
        obstime=moment,
        location=where,
        pressure=air.pressure_hpa * u.hPa,
        temperature=air.temperature_c * u.deg_C,
        relative_humidity=air.humidity,
        obswl=air.wavelength_um * u.micron,
    )
    ra, dec = (np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])), np.degrees(np.arcsin(vectors[:, 2])))
    there = SkyCoord(ra * u.deg, dec * u.deg).transform_to(frame)
    return there.alt.deg, there.az.deg


@pytest.mark.parametrize("site", SITES)
@pytest.mark.parametrize("air", [Atmosphere(), Atmosphere(pressure_hpa=0.0)])
def test_directions_are_those_of_astropy(site, air):
    vectors = _random_vectors()
    altitude, azimuth = _astropy_altaz(vectors, site, air)
    mine = LocalSky(site, NOW, air).to_enu(vectors)
    up = altitude > 5.0
    assert up.sum() > 100
    theirs = unit_vectors(90.0 - azimuth[up], altitude[up])  # east, north, up
    away = np.degrees(np.linalg.norm(mine[up] - theirs, axis=1)) * 3600.0
    assert away.max() < 1.0
    np.testing.assert_allclose(altitude_deg(mine[up]), altitude[up], atol=1 / 3600)


@pytest.mark.parametrize("site", SITES)
def test_directions_come_back(site):
    sky, vectors = LocalSky(site, NOW), _random_vectors(200, 2)
    seen = sky.to_enu(vectors)
    high = seen[:, 2] > 0.2
    np.testing.assert_allclose(sky.from_enu(seen[high]), vectors[high], atol=2e-8)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), 1.0, atol=1e-12)


def test_refraction_raises_by_the_table():
    """Bennett (1982): about 1.0' at 45 deg, 5.3' at 10 deg, for 1010 hPa and 10 C."""
    site = SITES[0]
    vectors = _random_vectors(4000, 3)
    bare = LocalSky(site, NOW, Atmosphere(pressure_hpa=0.0)).to_enu(vectors)
    bent = LocalSky(site, NOW, Atmosphere(humidity=0.0)).to_enu(vectors)
    lift = (altitude_deg(bent) - altitude_deg(bare)) * 60.0
    for altitude, arcmin in ((45.0, 0.98), (20.0, 2.65), (10.0, 5.35)):
        near = abs(altitude_deg(bent) - altitude) < 1.0
        assert np.median(lift[near]) == pytest.approx(arcmin, rel=0.05)
    assert abs(azimuth_deg(bent) - azimuth_deg(bare))[bare[:, 2] > 0.1].max() < 1e-9


@pytest.mark.parametrize("site", SITES)
def test_the_pole_stands_at_the_latitude_and_air_lifts_it(site):
    sky = LocalSky(site, NOW)
    true = LocalSky(site, NOW, Atmosphere(pressure_hpa=0.0)).pole_enu()
    assert altitude_deg(true) == pytest.approx(abs(site.latitude_deg), abs=1 / 3600)
    assert azimuth_deg(true + np.array([1e-12, 0, 0])) == pytest.approx(
        0.0 if site.latitude_deg > 0 else 180.0, abs=0.01
    )
    assert altitude_deg(sky.pole_enu()) > altitude_deg(true)


def test_of_date_is_what_the_existing_room_says():
    from datetime import UTC, datetime

    from kochab.core.attitude import radec_deg
    from kochab.sky.apparent import apparent

    moment = datetime.fromtimestamp(NOW, UTC)
    for vector in _random_vectors(5, 4):
        ra, dec = radec_deg(apparent(vector, moment))
        mine = LocalSky(SITES[0], NOW).of_date(vector)
        np.testing.assert_allclose(unit_vectors(*mine), unit_vectors(ra, dec), atol=1e-7)
