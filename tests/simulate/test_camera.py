"""Light on the sensor: places, trails, extinction, refraction, Moon, clouds, and what sensors do."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.simulate import camera as cameras
from kochab.simulate.camera import CameraConfig, SkyCamera
from kochab.simulate.exposure import StarPaths, background, sky_electrons, starlight
from kochab.simulate.mechanics.geometry import Build, camera_to_enu, mount_to_enu
from kochab.simulate.night_sky import (
    Atmosphere,
    LocalSky,
    SunAndMoon,
    Weather,
    WeatherConfig,
    airmass,
    altitude_deg,
    midnight_unix,
    sun_and_moon,
    surface_mag,
)
from kochab.simulate.star_images import Sensor
from kochab.sky.apparent import julian_years
from tests.simulate.rig_help import catalogue

SITE = Site(47.0, 8.0, 450.0)
DARK = midnight_unix(1_800_000_000.0, SITE)
CLEAR = Weather(WeatherConfig(), DARK)
SMALL = CameraConfig(width=320, height=240, fov_deg=1.2, hot_per_mp=0.0, rays_per_minute=0.0)


def length_px(paths):
    """How far the typical star travels over the sensor."""
    steps = np.linalg.norm(np.diff(paths.xy, axis=0), axis=2).sum(axis=0)
    return np.median(steps[np.isfinite(steps)])


def view(altitude=60.0, azimuth=180.0):
    """A camera that stands still: level, looking at this place."""
    seen = camera_to_enu(0.0, altitude, mount_to_enu(90.0, azimuth - 180.0), Build()).T
    assert altitude_deg(seen[2]) == pytest.approx(altitude)
    return lambda t: seen


def following(rate=15.041 / 3600.0, start=None):
    """A camera on a perfect axis that turns at this rate, degrees a second."""
    begin = DARK if start is None else start
    axis = mount_to_enu(47.0, 0.0)
    return lambda t: camera_to_enu(rate * (t - begin), 20.0, axis, Build()).T


def camera(config=SMALL, weather=CLEAR, **more):
    return SkyCamera(config, catalogue(), SITE, weather, **more)


def test_stars_are_where_erfa_and_the_camera_say():
    look, taker = view(), camera(replace(SMALL, zero_point_e_s=1e11))
    paths = taker.light(look, DARK, 0.001).paths
    sky = LocalSky(SITE, DARK + 0.0005)
    rows = catalogue().cone(sky.from_enu(look(DARK)[2]), np.radians(1.0), SMALL.faintest, 2027.0)
    year = julian_years(datetime.fromtimestamp(DARK, UTC))
    expected = taker.optics.project(sky.to_enu(catalogue().vectors(rows, year)) @ look(DARK).T)
    inside = (expected > 0).all(axis=1) & (expected < [320, 240]).all(axis=1)
    drawn = paths.xy.mean(axis=0)
    gaps = np.linalg.norm(expected[inside][:, None] - drawn, axis=2).min(axis=1)
    assert inside.sum() > 10
    assert gaps.max() < 1e-3


@pytest.mark.parametrize(("drift", "exposure"), [(0.0, 4.0), (5.0, 2.0), (20.0, 3.0), (60.0, 1.0)])
def test_a_trail_is_as_long_as_drift_times_exposure(drift, exposure):
    """``drift`` arcsec a second against the stars; the declination shortens it on the sky."""
    look = following(15.041 / 3600.0 + drift / 3600.0)
    paths = camera().light(look, DARK, exposure).paths
    expected = drift * exposure * np.cos(np.radians(20.0)) / SMALL.optics().scale_arcsec_px
    assert length_px(paths) == pytest.approx(expected, rel=0.02, abs=0.05)


def test_a_trail_of_a_standing_camera_is_measured_in_the_frame():
    from kochab.detection import DETECTORS

    config = replace(SMALL, zero_point_e_s=2e9)
    frame = camera(config).frame(view(60.0), DARK, 2.0)
    found = DETECTORS.make().detect(frame)
    expected = 2.0 * 15.041 * np.cos(np.radians(17.0)) / SMALL.optics().scale_arcsec_px
    bright = found.snr > 50
    assert bright.sum() >= 3
    long = smear_px(found, bright)
    assert np.median(long) == pytest.approx(expected, rel=0.15)


def smear_px(found, chosen):
    """The even smear whose second moment makes a core as elongated as detected."""
    elongation, fwhm = found.elongation[chosen], found.fwhm_px[chosen]
    along2 = (fwhm**2) * elongation / 2.3548**2
    across2 = (fwhm**2) / elongation / 2.3548**2
    return np.sqrt(12.0 * np.maximum(along2 - across2, 0.0))


def test_air_takes_light_by_the_airmass():
    up = np.array([[0, 0, 1.0], [0, np.cos(np.radians(30)), 0.5], [0, np.cos(np.radians(10)), np.sin(np.radians(10))]])
    np.testing.assert_allclose(airmass(up), [1.0, 1.995, 5.6], rtol=0.01)
    high, low = camera(), camera()
    for taker, altitude in ((high, 80.0), (low, 15.0)):
        look = view(altitude)
        light = taker.light(look, DARK, 1.0)
        paths = light.paths
        lost = -2.5 * np.log10(starlight(light) / (SMALL.zero_point_e_s * 10 ** (-0.4 * paths.mag)))
        expected = 0.2 * airmass(paths.directions)
        np.testing.assert_allclose(lost, expected, atol=1e-9)
        assert np.median(lost) == pytest.approx(0.2 / np.sin(np.radians(altitude)), rel=0.02)


def test_refraction_moves_the_stars_of_a_low_frame(monkeypatch):
    bent = StarPaths(catalogue(), SITE).over(SMALL.optics(), view(15.0), DARK, 0.01, 13.0)
    airless = partial(LocalSky, air=Atmosphere(pressure_hpa=0.0))
    monkeypatch.setattr("kochab.simulate.exposure.LocalSky", airless)
    bare = StarPaths(catalogue(), SITE).over(SMALL.optics(), view(15.0), DARK, 0.01, 13.0)
    shared = sorted(set(np.round(bent.mag, 4)) & set(np.round(bare.mag, 4)))
    lift = [
        bare.xy[0, np.flatnonzero(np.round(bare.mag, 4) == m)[0], 1]
        - bent.xy[0, np.flatnonzero(np.round(bent.mag, 4) == m)[0], 1]
        for m in shared
        if (np.round(bare.mag, 4) == m).sum() == 1 and (np.round(bent.mag, 4) == m).sum() == 1
    ]
    assert len(lift) > 5
    assert np.median(lift) * SMALL.optics().scale_arcsec_px == pytest.approx(3.55 * 60, rel=0.1)


def test_the_moon_and_twilight_brighten_the_sky_and_clouds_hide_stars():
    up = np.array([[0.0, 0.0, 1.0]])
    down = np.array([0.0, 0.0, -1.0])
    moon = np.array([0.0, np.cos(np.radians(40)), np.sin(np.radians(40))])
    night = surface_mag(up, SunAndMoon(down, down, 90.0))[0]
    full = surface_mag(up, SunAndMoon(down, moon, 0.0))[0]
    half = surface_mag(up, SunAndMoon(down, moon, 90.0))[0]
    assert night == pytest.approx(20.5)
    assert 17.5 < full < 19.0  # Krisciunas and Schaefer: about 3 mag over a dark sky
    assert full < half < night
    near = surface_mag(moon[None], SunAndMoon(down, moon, 0.0))[0]
    assert near < full - 1.0
    dusk = np.array([0.0, np.cos(np.radians(-6)), np.sin(np.radians(-6))])
    assert surface_mag(up, SunAndMoon(dusk, down, 90.0))[0] == pytest.approx(13.5, abs=0.2)

    weather = Weather(WeatherConfig(banks=((0.0, 100.0, 3.0),)), DARK - 50.0)
    clear, cloudy = camera(), camera(weather=weather)
    look = view()
    stars = [starlight(c.light(look, DARK, 1.0)) for c in (clear, cloudy)]
    np.testing.assert_allclose(stars[1], stars[0] * 10 ** (-0.4 * 3.0), rtol=1e-9)
    after = [starlight(c.light(look, DARK + 200, 1.0)) for c in (clear, cloudy)]
    np.testing.assert_allclose(after[1], after[0])


def test_patchy_cloud_covers_about_as_much_as_asked_and_drifts():
    rng = np.random.default_rng(0)
    up = rng.normal(size=(3000, 3))
    up = up[up[:, 2] > 0.5 * np.linalg.norm(up, axis=1)]
    up /= np.linalg.norm(up, axis=1)[:, None]
    for cover in (0.2, 0.6):
        shares = [(Weather(WeatherConfig(cover), DARK, seed).cloud_mag(up, DARK) > 0).mean() for seed in range(12)]
        assert np.mean(shares) == pytest.approx(cover, abs=0.12)
    weather = Weather(WeatherConfig(0.5), DARK, 1)
    now, later = (weather.cloud_mag(up, DARK + t) for t in (0.0, 300.0))
    assert abs(now - later).max() > 0.5
    np.testing.assert_array_equal(now, Weather(WeatherConfig(0.5), DARK, 1).cloud_mag(up, DARK))


def test_the_real_moon_and_sun_are_where_astropy_says():
    from astropy.coordinates import get_body
    from astropy.time import Time

    when = 1_720_000_000.0
    sky = LocalSky(SITE, when)
    light = sun_and_moon(sky, when)
    for body, mine in (("sun", light.sun), ("moon", light.moon)):
        place = get_body(body, Time(when, format="unix")).cartesian.xyz.value
        there = sky.to_enu(place / np.linalg.norm(place))
        assert np.degrees(np.linalg.norm(there - mine)) < 0.2


def test_the_sky_goes_on_smoothly_over_the_frame():
    taker, look = camera(), view(20.0)
    light = taker.light(look, DARK, 1.0)
    coarse, fine = sky_electrons(light), background(light)
    assert fine.shape == (240, 320)
    assert fine[0, 0] == pytest.approx(coarse[0, 0])
    assert fine[-1, -1] == pytest.approx(coarse[-1, -1])
    assert fine[-1].mean() > fine[0].mean()  # brighter towards the horizon
    assert abs(np.diff(fine, axis=0)).max() < 0.01 * fine.mean()


@pytest.mark.parametrize("cheap", [False, True])
def test_a_frame_has_noise_hot_pixels_in_place_and_the_seed_decides(cheap):
    config = replace(SMALL, hot_per_mp=200.0, cheap=cheap, hot_e_s=(1000.0, 3000.0))
    look = view()
    one, two = (camera(config, seed=5) for _ in range(2))
    first, again = one.frame(look, DARK, 1.0), two.frame(look, DARK, 1.0)
    np.testing.assert_array_equal(first.pixels, again.pixels)
    other = one.frame(look, DARK, 1.0)
    assert (other.pixels != first.pixels).any()
    hot = [set(np.flatnonzero(f.pixels.ravel() > 1000)) for f in (first, other)]
    assert len(hot[0] & hot[1]) >= 13
    quiet = np.median(abs(first.pixels - np.median(first.pixels))) * 1.4826
    sky = np.median(first.pixels) - 100.0
    assert quiet == pytest.approx(np.sqrt(sky + 25.0), rel=0.15)
    assert first.hint.time_utc.timestamp() == pytest.approx(DARK + 0.5)
    assert first.hint.exposure_s == 1.0
    assert first.hint.scale_arcsec_px[0] < SMALL.optics().scale_arcsec_px < first.hint.scale_arcsec_px[1]


def test_what_is_lost_in_the_noise_is_not_drawn():
    taker = camera()
    assert taker.faintest(0.01) < taker.faintest(1.0) <= taker.faintest(600.0) == SMALL.faintest
    look = view()
    short, long = (taker.light(look, DARK, s).paths.mag.max() for s in (0.01, 60.0))
    assert short <= taker.faintest(0.01) < long


def test_sensors_saturate_and_have_mosaics_and_gain():
    look = view()
    bright = replace(SMALL, zero_point_e_s=1e12, sensor=Sensor(1.0, 5.0, 100.0, saturation=4095.0))
    assert camera(bright).frame(look, DARK, 1.0).pixels.max() == 4095
    mosaic = replace(SMALL, sensor=Sensor(1.0, 5.0, 0.0, bayer="RGGB"), zero_point_e_s=2e9)
    frame = camera(mosaic).frame(look, DARK, 1.0)
    assert frame.bayer == "RGGB"
    red, green = np.median(frame.pixels[::2, ::2]), np.median(frame.pixels[::2, 1::2])
    assert red == pytest.approx(0.6 * green, rel=0.02)
    taker = camera(replace(SMALL, sensor=Sensor(1.0, 5.0, 0.0), zero_point_e_s=2e9))
    one, four = (np.median(taker.frame(look, DARK, 1.0, g).pixels) for g in (1.0, 4.0))
    assert one == pytest.approx(4 * four, rel=0.02)


def test_a_frame_taken_while_it_slews_is_made_of_long_trails():
    paths = camera().light(following(2.0), DARK, 1.0).paths
    assert length_px(paths) > 300.0
    frame = camera().frame(following(2.0), DARK, 1.0)
    assert frame.pixels.shape == (240, 320)


def test_stars_whose_light_a_slew_loses_in_the_noise_are_left_out_and_no_other(monkeypatch):
    """Trails that nobody sees took a second of each frame."""
    drawn, add = [], cameras.add_stars

    def counted(light, xy, flux, image):
        drawn.append(len(xy))
        add(light, xy, flux, image)

    monkeypatch.setattr(cameras, "add_stars", counted)
    config = replace(SMALL, fov_deg=4.0, sensor=Sensor(gain_e=0.05))
    kept = camera(config).frame(following(2.0), DARK, 1.0).pixels.astype(float)
    monkeypatch.setattr(cameras, "LONG_TRAIL", np.inf)
    every = camera(config).frame(following(2.0), DARK, 1.0).pixels.astype(float)
    assert drawn[0] < 0.5 * drawn[1]
    noise = np.std(np.diff(every, axis=1)) / np.sqrt(2.0)
    assert np.abs(kept - every).max() < noise
    assert kept.std() > 1.5 * noise, "bright stars' trails are there"
