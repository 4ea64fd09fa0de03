"""Places on the ground against astropy, and the size of every systematic that is taken out."""

from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.attitude import ARCSEC, Attitude, angle_between, attitude_from, unit_vectors
from kochab.core.frame import Site
from kochab.polar.error import (
    PolarError,
    altitude_in_words,
    angle_in_words,
    azimuth_in_words,
    sayable,
    split_in_words,
    total_in_words,
    turns_in_words,
)
from kochab.polar.pole import Pole, name_of, northern, pole_direction
from kochab.polar.rotations import alt_az
from kochab.polar.sighting import LocalAttitude, Sighting, covariance_of, to_local
from kochab.sky.horizon import Horizon, Refraction

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
    high = there.alt.deg > 11.0  # lower, ERFA holds no longer: tests/sky/test_horizon.py
    seen = Horizon(site, WHEN, air).observed(unit_vectors(ra, dec))
    gap = np.linalg.norm(seen - want, axis=1)[high] / ARCSEC
    # UT1 - UTC, 44 ms that day, turns all the sky about the pole; polar motion 0.5 arcsec
    assert gap.max() < 1.5


@pytest.mark.parametrize("site", [SITE, Site(-33.5, -70.7, 2400.0)])
@pytest.mark.parametrize("when", [WHEN, WHEN.replace(month=9, hour=4)])
def test_observed_places_are_those_of_erfas_own_chain(site, when):
    """Leap seconds, precession, aberration of both kinds, refraction: ``atco13`` with UT1 = UTC, to a millisecond of arc."""
    import erfa

    rng = np.random.default_rng(4)
    ra, dec = rng.uniform(0.0, 2.0 * np.pi, 50), np.arcsin(rng.uniform(-1.0, 1.0, 50))
    utc = erfa.dtf2d("UTC", when.year, when.month, when.day, when.hour, when.minute, float(when.second))
    place = (np.radians(site.longitude_deg), np.radians(site.latitude_deg), site.height_m)
    air = Refraction(900.0, 7.0, 0.2, 0.6)
    weather = (air.pressure_hpa, air.temperature_c, air.humidity, air.wavelength_um)
    azimuth, zenith, *_ = erfa.atco13(ra, dec, 0.0, 0.0, 0.0, 0.0, *utc, 0.0, *place, 0.0, 0.0, *weather)
    high = zenith < np.radians(79.0)
    vectors = unit_vectors(np.degrees(ra), np.degrees(dec))
    seen = Horizon(site, when, air).observed(vectors)[high]
    level = np.sin(zenith[high])
    expected = np.stack([level * np.sin(azimuth[high]), level * np.cos(azimuth[high]), np.cos(zenith[high])], axis=-1)
    assert np.abs(seen - expected).max() < 1e-3 * ARCSEC


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


@pytest.mark.parametrize("place", [(120.0, 35.0), (300.0, 60.0), (20.0, -10.0), (200.0, 89.0)])
def test_altitude_and_azimuth_are_those_of_the_direction(place):
    """Azimuth from north through east, in a whole circle."""
    vector = unit_vectors(*place)
    east, north, up = Horizon(SITE, WHEN).observed(vector)[0]
    altitude, azimuth = Horizon(SITE, WHEN).altaz_deg(vector)
    assert np.sin(np.radians(altitude)) == pytest.approx(up)
    assert (np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))) == (
        pytest.approx(east / np.hypot(east, north)),
        pytest.approx(north / np.hypot(east, north)),
    )
    assert 0.0 <= azimuth < 360.0


def test_half_the_sky_has_an_azimuth_beyond_half_a_circle():
    vectors = unit_vectors(np.arange(0.0, 360.0, 15.0), np.zeros(24))
    azimuths = np.array([Horizon(SITE, WHEN).altaz_deg(v)[1] for v in vectors])
    assert ((azimuths > 180.0).sum(), (azimuths < 180.0).sum()) == (12, 12)
    assert azimuths.max() < 360.0


# -- Numbers and words of an error ----------------------------------------------------------------


def tilted(angle_rad=0.5, long=30.0, short=10.0, shift=(0.0, 0.0)):
    """An error whose ellipse is tilted from azimuth towards altitude."""
    error = error_with(*shift)
    along, across = np.array([np.sin(angle_rad), np.cos(angle_rad)]), np.array([np.cos(angle_rad), -np.sin(angle_rad)])
    covariance = (long**2 * np.outer(along, along) + short**2 * np.outer(across, across)) * ARCSEC**2
    return PolarError(error.axis, error.pole, covariance, np.diag([16.0, 9.0]) * ARCSEC**2)


def test_an_ellipse_holds_its_share_and_points_where_it_is_long():
    long, short, angle = tilted().ellipse_arcsec()
    assert (long, short) == (
        pytest.approx(30.0 * np.sqrt(2.2957), rel=1e-3),
        pytest.approx(10.0 * np.sqrt(2.2957), rel=1e-3),
    )
    assert np.tan(angle) == pytest.approx(np.tan(0.5))
    assert tilted().ellipse_arcsec(0.95)[0] == pytest.approx(30.0 * np.sqrt(5.9915), rel=1e-3)


def test_the_sigma_of_the_total_is_that_along_its_line():
    """Along the ellipse it is the long one, across the short, and at the pole the mean of both."""
    on_sky = np.cos(alt_az(pole_direction(SITE))[0])
    for angle, sigma in ((0.5, 30.0), (0.5 + np.pi / 2.0, 10.0)):
        shift = (1000.0 * np.sin(angle), 1000.0 * np.cos(angle) / on_sky)
        assert tilted(shift=shift).sigma_total_arcsec == pytest.approx(sigma, rel=0.02)
    assert tilted().sigma_total_arcsec == pytest.approx(np.sqrt((30.0**2 + 10.0**2) / 2.0))
    assert tilted().uncertainty_arcsec == pytest.approx(np.hypot(30.0, 10.0))


def test_flexure_comes_on_top_in_squares():
    error = tilted(0.0, 30.0, 10.0, (500.0, 0.0))
    assert error.flexure_arcsec == pytest.approx((4.0, 3.0))
    assert error.flexure_total_arcsec == pytest.approx(5.0)
    assert error.with_systematics.sigma_arcsec == pytest.approx((np.hypot(10.0, 4.0), np.hypot(30.0, 3.0)))
    assert error.with_systematics.flexure_total_arcsec == 0.0
    assert error.flexure_along_arcsec == pytest.approx(4.0, rel=1e-3)
    assert error.sigma_total_arcsec == pytest.approx(10.0, rel=1e-3)
    assert split_in_words(error) == "10″ measurement, 4″ possible flexure"
    assert total_in_words(error) == "8.3′ ± 11″"


@pytest.mark.parametrize(("sigmas", "below"), [(1.49, True), (1.54, False)])
def test_an_error_is_below_its_uncertainty_inside_the_68_percent_ellipse(sigmas, below):
    """A radius of 1.515 sigmas of two dimensions, in altitude and in azimuth on the sky."""
    on_sky = np.cos(alt_az(pole_direction(SITE))[0])
    for shift in ((2.0 * sigmas, 0.0), (0.0, 3.0 * sigmas / on_sky)):
        error = error_with(*shift)
        assert error.below_uncertainty is below
        assert error.distance2(error.pole) == pytest.approx(sigmas**2, rel=1e-3)


def test_an_azimuth_across_the_south_is_the_short_way_round():
    """South of the equator the azimuth of the pole is where the count starts anew."""
    pole = pole_direction(Site(-35.0, 0.0))
    for shift in (600.0, -600.0):
        error = error_with(100.0, shift, pole)
        assert error.azimuth_arcsec == pytest.approx(shift, abs=1e-6)
        assert error.distance2(pole) == pytest.approx(
            50.0**2 + (shift * np.cos(alt_az(error.axis)[0]) / 3.0) ** 2, rel=1e-6
        )


@pytest.mark.parametrize(
    ("arcsec", "words"),
    [
        (0.4, "0″"),
        (-45.0, "45″"),
        (99.4, "99″"),
        (99.6, "1.7′"),
        (5390.0, "89.8′"),
        (5410.0, "1.50°"),
        (-36000.0, "10.00°"),
    ],
)
def test_angles_have_the_unit_that_suits_them(arcsec, words):
    assert angle_in_words(arcsec) == words


@pytest.mark.parametrize(
    ("turns", "words"),
    [
        (1 / 180, "2°"),
        (0.125, "an eighth of a turn"),
        (0.5, "half a turn"),
        (0.625, "five eighths of a turn"),
        (0.75, "three quarters of a turn"),
        (0.875, "seven eighths of a turn"),
        (1.0, "one turn"),
        (1.125, "one and an eighth turns"),
        (3.5, "three and a half turns"),
        (10.0, "ten turns"),
        (11.0, "11 turns"),
        (0.1, "36°"),
        (0.0, "0°"),
    ],
)
def test_every_eighth_of_a_turn_has_its_word(turns, words):
    assert turns_in_words(turns) == turns_in_words(-turns) == words


@pytest.mark.parametrize(
    ("turns", "said"),
    [(0.99, 0.875), (0.126, 0.125), (0.124, 44.0 / 360.0), (0.05, 15.0 / 360.0), (0.04, 14.0 / 360.0), (0.004, 0.0)],
)
def test_a_turn_is_said_in_eighths_then_in_fives_then_in_twos_of_a_degree(turns, said):
    said = 40.0 / 360.0 if turns == 0.124 else said
    assert sayable(turns) == pytest.approx(said)
    assert sayable(-turns) == pytest.approx(-said)


def test_what_to_do_is_said_with_one_sigma():
    error = error_with(300.0, -400.0)
    assert altitude_in_words(error) == "5.0′ ± 2″ too high: lower the axis"
    assert azimuth_in_words(error) == "6.7′ ± 4″ too far west: rotate the mount clockwise, seen from above"


@pytest.mark.parametrize(
    ("shift", "altitude", "azimuth"),
    [
        (0.6, "1″ ± 2″ too high: lower the axis", "1″ ± 4″ too far east: rotate the mount anticlockwise"),
        (-0.6, "1″ ± 2″ too low: raise the axis", "1″ ± 4″ too far west: rotate the mount clockwise"),
        (0.0, "0″ ± 2″ too low: raise the axis", "0″ ± 4″ too far west: rotate the mount clockwise"),
    ],
)
def test_an_arcsecond_has_a_side_and_none_has_always_the_same(shift, altitude, azimuth):
    error = error_with(shift, shift)
    assert altitude_in_words(error) == altitude
    assert azimuth_in_words(error) == f"{azimuth}, seen from above"


def test_a_frame_belongs_to_the_first_sweep_unless_told():
    attitude = Attitude(attitude_from(120.0, 35.0, 40.0).matrix, np.eye(3) * ARCSEC**2)
    first, third = Sighting(attitude, WHEN), Sighting(attitude, WHEN, sweep=2)
    assert (first.sweep, first.label, first.field_deg) == (0, "", (2.0, 2.0))
    assert [to_local(one, SITE).sweep for one in (first, third)] == [0, 2]
    assert LocalAttitude(np.eye(3), np.eye(3), WHEN).sweep == 0


def test_refraction_is_that_of_the_eye_in_usual_air():
    """In green light air of 15 °C bends by n - 1 = 2.779e-4 (Edlén 1966, Metrologia 2, 71); ours has 10 °C."""
    a, _ = Refraction().constants(Site(0.0, 0.0, 0.0))
    assert a == pytest.approx(2.779e-4 * 288.15 / 283.15, rel=0.005)
    cold, thin = Refraction(temperature_c=-20.0), Refraction(pressure_hpa=700.0)
    assert cold.constants(SITE)[0] / Refraction().constants(SITE)[0] == pytest.approx(283.15 / 253.15, rel=0.01)
    assert thin.constants(SITE)[0] / a == pytest.approx(700.0 / 1013.25, rel=0.01)
