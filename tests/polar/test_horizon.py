"""Places on the ground against astropy, and the size of every systematic that is taken out."""

from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.attitude import Attitude, angle_between, attitude_from, unit_vectors
from kochab.core.frame import Site
from kochab.polar.error import PolarError
from kochab.polar.horizon import Horizon, Pole, Refraction, name_of, northern, pole_direction
from kochab.polar.rotations import ARCSEC, alt_az
from kochab.polar.sighting import Sighting, covariance_of, to_local

WHEN = datetime(2025, 3, 14, 21, 30, tzinfo=UTC)
SITE = Site(40.0, 11.5, 520.0)
VACUUM = Refraction(pressure_hpa=0.0)


@pytest.mark.parametrize("air", [VACUUM, Refraction(950.0, 5.0, 0.3)])
@pytest.mark.parametrize("site", [SITE, Site(-33.5, -70.7, 2400.0), Site(70.0, 25.0)])
def test_observed_places_agree_with_astropy(site, air):
    import astropy.units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    rng = np.random.default_rng(3)
    ra, dec = rng.uniform(0, 360, 200), rng.uniform(-90, 90, 200)
    place = EarthLocation(site.longitude_deg * u.deg, site.latitude_deg * u.deg, site.height_m * u.m)
    frame = AltAz(
        obstime=Time(WHEN),
        location=place,
        pressure=air.pressure_at(site) * u.hPa,
        temperature=air.temperature_c * u.deg_C,
        relative_humidity=air.humidity,
        obswl=air.wavelength_um * u.micron,
    )
    there = SkyCoord(ra * u.deg, dec * u.deg).transform_to(frame)
    want = np.stack(
        [np.cos(there.alt) * np.sin(there.az), np.cos(there.alt) * np.cos(there.az), np.sin(there.alt)], axis=-1
    )
    high = there.alt.deg > 5.0
    seen = Horizon(site, WHEN, air).observed(unit_vectors(ra, dec))
    gap = np.linalg.norm(seen - want, axis=1)[high] / ARCSEC
    # UT1 - UTC, 44 ms that day, turns all the sky about the pole; polar motion 0.5 arcsec
    assert gap.max() < 1.5


def test_the_pole_is_as_high_as_the_latitude_and_the_air_lifts_it():
    for latitude in (10.0, 40.0, 85.0, -10.0, -40.0, -85.0):
        site = Site(latitude, 0.0)
        true, seen, middle = (alt_az(pole_direction(site, kind)) for kind in (Pole.TRUE, Pole.REFRACTED, Pole.HALF_WAY))
        assert np.degrees(true[0]) == pytest.approx(abs(latitude))
        assert true[1] == pytest.approx(0.0 if latitude > 0 else np.pi)
        lift = (seen[0] - true[0]) / ARCSEC
        # the usual 58.3 arcsec x tan z at sea level and 10 deg C
        assert lift == pytest.approx(58.0 / np.tan(np.radians(abs(latitude))), rel=0.06)
        assert middle[0] == pytest.approx((true[0] + seen[0]) / 2.0)
        assert northern(site) is (latitude > 0)


def test_without_air_the_poles_are_one():
    assert pole_direction(SITE, Pole.REFRACTED, VACUUM) == pytest.approx(pole_direction(SITE, Pole.TRUE), abs=1e-9)


def test_the_pole_is_named():
    assert name_of(Pole.TRUE, SITE) == "true north pole at altitude 40.00°"
    assert name_of(Pole.REFRACTED, Site(-40.0, 0.0)).startswith("refracted south pole")


def test_the_star_at_the_pole_of_date_is_seen_at_the_refracted_pole():
    """And that of J2000 is 9 arcmin away by now, as precession has it (20 arcsec a year)."""
    from kochab.sky.apparent import of_date_matrix, without_aberration

    of_date = without_aberration(of_date_matrix(WHEN)[2], WHEN)
    seen = Horizon(SITE, WHEN).observed(of_date)[0]
    assert angle_between(seen, pole_direction(SITE)) < 0.5 * ARCSEC  # diurnal aberration
    of_2000 = Horizon(SITE, WHEN).observed(np.array([0.0, 0.0, 1.0]))[0]
    assert 8.2 < angle_between(of_2000, pole_direction(SITE)) / ARCSEC / 60.0 < 8.8


def test_a_camera_is_carried_to_the_ground_with_its_roll():
    """Its axes show the directions its own pixels see, refraction's squeeze of the field apart."""
    attitude = attitude_from(120.0, 35.0, 40.0)
    sighting = Sighting(Attitude(attitude.matrix, np.eye(3) * ARCSEC**2), WHEN, (1.0, 0.7), "one")
    local = to_local(sighting, SITE)
    for corner in ([0, 0, 1.0], [0.008, 0.006, 1.0], [-0.008, 0.006, 1.0]):
        ray = np.array(corner) / np.linalg.norm(corner)
        seen = Horizon(SITE, WHEN).observed(ray @ attitude.matrix)[0]
        assert angle_between(local.matrix @ ray, seen) < 3.0 * ARCSEC
    assert np.linalg.det(local.matrix) == pytest.approx(1.0)
    assert local.label == "one"
    assert local.altitude_deg == pytest.approx(Horizon(SITE, WHEN).altaz_deg(attitude.boresight)[0], abs=1e-3)


def test_an_attitude_without_errors_cannot_be_weighed():
    with pytest.raises(ValueError, match="covariance"):
        covariance_of(attitude_from(0.0, 0.0, 0.0))


def error_with(shift_alt, shift_az, pole=None):
    pole = pole_direction(SITE) if pole is None else pole
    alt, az = alt_az(pole)
    from kochab.polar.rotations import direction

    axis = direction(alt + shift_alt * ARCSEC, az + shift_az * ARCSEC)
    return PolarError(axis, pole, np.diag([4.0, 9.0]) * ARCSEC**2)


def test_the_error_has_its_signs_and_its_share_of_azimuth():
    error = error_with(300.0, -400.0)
    assert error.altitude_arcsec == pytest.approx(300.0)  # too high
    assert error.azimuth_arcsec == pytest.approx(-400.0)  # too far anticlockwise: west, in the north
    assert error.axis[0] < 0
    assert error.azimuth_on_sky_arcsec == pytest.approx(-400.0 * np.cos(np.radians(40.1)), rel=1e-3)
    assert error.total_arcsec == pytest.approx(np.hypot(300.0, error.azimuth_on_sky_arcsec), rel=1e-3)
    assert error.sigma_arcsec == pytest.approx((2.0, 3.0))
    assert error.sigma_azimuth_arcsec == pytest.approx(3.0 / np.cos(np.radians(40.1)), rel=1e-3)
    assert not error.below_uncertainty
    assert error_with(1.0, 1.0).below_uncertainty


def test_in_the_south_clockwise_is_to_the_west():
    site = Site(-35.0, 0.0)
    error = error_with(0.0, 600.0, pole_direction(site))
    assert error.azimuth_arcsec == pytest.approx(600.0)
    assert error.axis[0] < 0


def test_the_ellipse_is_that_of_the_covariance():
    long, short, angle = error_with(0.0, 0.0).ellipse_arcsec()
    assert long == pytest.approx(3.0 * np.sqrt(2.2957), rel=1e-3)
    assert short == pytest.approx(2.0 * np.sqrt(2.2957), rel=1e-3)
    assert abs(np.sin(angle)) < 1e-9  # along azimuth
    assert error_with(0.0, 0.0).ellipse_arcsec(0.95)[0] > long


@pytest.mark.parametrize(("height_m", "hpa"), [(0.0, 1013.25), (2400.0, 756.3), (5000.0, 540.2)])
def test_the_air_is_as_thin_as_the_site_is_high(height_m, hpa):
    """Against the international standard atmosphere (ISO 2533)."""
    assert Refraction().pressure_at(Site(0.0, 0.0, height_m)) == pytest.approx(hpa, rel=0.04)
    assert Refraction(880.0).pressure_at(Site(0.0, 0.0, height_m)) == 880.0


def test_the_totals_sigma_is_along_the_line_from_pole_to_axis():
    for shift, sigma in (((300.0, 0.0), 2.0), ((0.0, 300.0), 3.0)):
        assert error_with(*shift).sigma_total_arcsec == pytest.approx(sigma, rel=1e-3)
