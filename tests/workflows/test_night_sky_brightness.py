"""Sky brightness and limiting magnitude: of frames rendered here from their definitions, and beside photutils."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from kochab.core.attitude import attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.progress import run
from kochab.core.solution import NamedStar, Solution
from kochab.sky.catalogue import open_catalogue
from kochab.solver import SolveOptions
from kochab.workflows.night import sky_brightness as sky
from kochab.workflows.night.frame import NightFrame, measure_frame
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.page import night_page
from kochab.workflows.night.summary import night_of

SIZE, SCALE, FWHM, GAIN_E, BLACK = 800, 12.0, 3.0, 1.5, 512.0
SKY_MAG, AIRMASS, ZERO_E = 20.7, 1.4, 4e8
HALO_PX = 4.5
NOON = datetime(2026, 3, 1, 22, tzinfo=UTC)
SHARED = Path(__file__).parents[3] / "shared" / "frames"


def rendered(seed, mosaic=False, mag=SKY_MAG, per_colour=-0.2, vignette=0.5, halo=0.0, extra=()):
    """A frame of the sky around (120, 25) deg, its detections and its solution.

    Electrons of a star are ``ZERO_E 10^(-0.4 (V + 0.2 X + k (B-V - 0.8)))``, of a pixel of sky
    ``ZERO_E 10^(-0.4 mag) area``: the air dims stars alone, and both are vignetted. ``halo``
    is the share of a star's light that is spread over ``HALO_PX``.
    """
    rng, catalogue = np.random.default_rng(seed), open_catalogue()
    camera = Camera.centred(SIZE, SIZE, 206264.8 / SCALE)
    frame = Solution(camera, attitude_from(120.0, 25.0, 20.0), (), 0.2, -30.0, "")
    rows = catalogue.brightest(frame.centre_vector, frame.radius_rad, 3000)
    xy, mags, colours = frame.pixels_of(catalogue.vectors(rows)), catalogue.mag(rows), catalogue.bv(rows)
    inside = ((xy > 30) & (xy < SIZE - 30)).all(axis=1) & np.isfinite(colours)
    rows, xy, mags, colours = rows[inside], xy[inside], mags[inside], colours[inside]
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    flat = 1.0 - vignette * np.hypot(x - SIZE / 2, y - SIZE / 2) ** 2 / (SIZE**2 / 2)
    light = ZERO_E * 10.0 ** (-0.4 * mag) * SCALE**2 * np.ones((SIZE, SIZE))
    s = FWHM / 2.3548
    extra_xy = np.array(extra or np.empty((0, 3)))
    stars_e = ZERO_E * 10.0 ** (-0.4 * (mags + 0.2 * AIRMASS + per_colour * (colours - 0.8)))
    for (px, py), e in zip([*xy, *extra_xy[:, :2]], [*stars_e, *extra_xy[:, 2]], strict=True):
        here = np.s_[max(int(py) - 20, 0) : int(py) + 21, max(int(px) - 20, 0) : int(px) + 21]
        far2 = (x[here] - px) ** 2 + (y[here] - py) ** 2
        for share, wide in ((1.0 - halo, s), (halo, HALO_PX)) if halo else ((1.0, s),):
            light[here] += share * e / (2 * np.pi * wide**2) * np.exp(-far2 / (2 * wide**2))
    light *= flat
    if mosaic:
        light *= np.tile([[0.6, 1.0], [1.0, 0.7]], (SIZE // 2, SIZE // 2))
    counts = rng.poisson(light) / GAIN_E + rng.normal(BLACK, 3.0, light.shape)
    pixels = np.clip(np.rint(counts), 0, 65535).astype(np.uint16)
    brightest = np.argsort(mags)
    xy, rows = xy[brightest], rows[brightest]
    peaks = stars_e[brightest] / GAIN_E / (2 * np.pi * s**2)
    n, noise = len(rows), float(np.sqrt(np.median(light)) / GAIN_E)
    found = Detections(
        SIZE, SIZE, xy, peaks * 7.0, peaks * 7.0 / noise / 4.0, np.full(n, FWHM), np.ones(n), np.zeros(n),
        peaks > 40000.0, np.zeros(n, dtype=bool), float(np.median(pixels)), noise,
    )  # fmt: skip
    stars = tuple(
        NamedStar(px, py, f"{row}", "", float(mag), *radec_deg(vector), 0.1)
        for (px, py), row, mag, vector in zip(xy, rows, mags[brightest], catalogue.vectors(rows), strict=True)
    )
    frame = Frame(pixels, bayer="RGGB" if mosaic else None, hint=Hint(exposure_s=30.0))
    return frame, found, replace(Solution(camera, attitude_from(120.0, 25.0, 20.0), stars, 0.2, -30.0, ""))


@pytest.mark.parametrize(("mosaic", "per_colour", "mag"), [(False, -0.2, 20.7), (True, 0.0, 20.7), (False, 0.3, 18.2)])
def test_the_brightness_of_a_rendered_sky_is_found(mosaic, per_colour, mag):
    stars = sky.stars_on_sky(*rendered(3, mosaic, mag, per_colour))
    found = sky.brightness_of(stars, Measure(BLACK, 2.0), AIRMASS)
    assert found.value == pytest.approx(mag, abs=0.04)
    assert found.sigma < 0.2
    wrong = sky.brightness_of(stars, Measure(0.0, 2.0), AIRMASS)
    assert abs(wrong.value - mag) > 0.2, "black is what it hangs on"


def test_a_halo_beyond_the_aperture_is_part_of_the_stars_light():
    """Of a Gaussian of 4.5 px, 22 % lie between the aperture's 2.5 FWHM and 4 FWHM; half of the light is in it."""
    stars = sky.stars_on_sky(*rendered(3, halo=0.5))
    assert stars.left_out_mag == pytest.approx(-2.5 * np.log10(1.0 - 0.5 * 0.22), abs=0.02)
    assert sky.brightness_of(stars, Measure(BLACK, 2.0), AIRMASS).value == pytest.approx(SKY_MAG, abs=0.04)


def test_cloud_dims_the_stars_and_not_the_sky():
    stars = sky.stars_on_sky(*rendered(4))
    dimmed = replace(stars, light=stars.light * 10.0**-0.4)
    clear = sky.brightness_of(stars, Measure(BLACK, 2.0), AIRMASS)
    clouded = sky.brightness_of(dimmed, Measure(BLACK, 2.0), AIRMASS, Measure(1.0, 0.05))
    assert clouded.value == pytest.approx(clear.value, abs=1e-6)
    assert clouded.sigma > clear.sigma


def test_a_sky_that_is_hardly_above_black_has_no_brightness():
    stars = sky.stars_on_sky(*rendered(5))
    assert sky.brightness_of(stars, Measure(stars.level.mean() - 8.0, 2.0), AIRMASS) is None


@pytest.mark.parametrize("mosaic", [False, True])
def test_the_faintest_star_is_one_of_five_times_its_noise(mosaic):
    """Stars of that magnitude, put into a frame at known places and measured by their profile."""
    first = sky.stars_on_sky(*rendered(6, mosaic, vignette=0.0))
    limit = sky.faintest_of(first).value
    places = [(x, y) for x in range(60, 740, 24) for y in range(60, 740, 24)]
    electrons = ZERO_E * 10.0 ** (-0.4 * (limit + 0.2 * AIRMASS))
    planted = rendered(7, mosaic, vignette=0.0, extra=[(x, y, electrons) for x, y in places])[0].pixels.astype(float)
    without, again = (rendered(seed, mosaic, vignette=0.0)[0].pixels.astype(float) for seed in (8, 9))
    s = FWHM / 2.3548
    dy, dx = np.mgrid[-8:9, -8:9]
    profile = np.exp(-(dx**2 + dy**2) / (2 * s**2))
    profile -= profile.mean()

    def fluxes(pixels):
        return np.array([(pixels[y - 8 : y + 9, x - 8 : x + 9] * profile).sum() for x, y in places])

    noise = 1.4826 * np.median(np.abs(fluxes(without) - fluxes(again))) / np.sqrt(2.0)
    assert np.median(fluxes(planted) - fluxes(without)) / noise == pytest.approx(5.0, abs=0.6)


def test_the_sky_of_a_ring_is_what_astropys_clipping_leaves():
    from astropy.stats import sigma_clip

    chance = np.random.default_rng(3)
    rings = np.round(chance.normal(1000.0, 30.0, (40, 600)))
    rings[:, :25] += chance.exponential(600.0, (40, 25))  # stars, as many as clipping in rounds takes in turn
    rings[:, 25:150] = np.nan  # outside the ring
    rings[1:20, 150:450] = np.nan  # rings of other sizes
    rings[0] = 7.0
    level, noise = sky._sky(chance.permuted(rings, axis=1))
    left = sigma_clip(np.ma.masked_invalid(rings), 3.0, maxiters=4, cenfunc="median", stdfunc="std", axis=1)
    np.testing.assert_allclose(level, left.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(noise, left.std(axis=1), atol=1e-9)


@pytest.mark.parametrize("name", ["exo__HATP-32171220013343.FITS", "pleiades.fits"])
def test_light_and_sky_are_those_of_photutils(name, monkeypatch):
    aperture = pytest.importorskip("photutils.aperture")
    from astropy.stats import SigmaClip

    path = SHARED / name if name.startswith("exo") else Path(__file__).parents[2] / "resources" / "samples" / name
    if not path.exists():
        pytest.skip("needs the shared frames")
    kept, measure = {}, sky._photometry

    def seen(frame, xy, fwhm, half):
        kept.update(pixels=frame.pixels.astype(float), xy=xy, fwhm=fwhm, found=measure(frame, xy, fwhm, half))
        return kept["found"]

    monkeypatch.setattr(sky, "_photometry", seen)
    run(measure_frame(str(path), SolveOptions()))
    light, _, level, noise = kept["found"]
    ring = aperture.CircularAnnulus(kept["xy"], sky.INNER * kept["fwhm"], sky.OUTER * kept["fwhm"])
    ring = aperture.ApertureStats(kept["pixels"], ring, sigma_clip=SigmaClip(3.0, maxiters=4), sum_method="center")
    disc = aperture.CircularAperture(kept["xy"], sky.APERTURE * kept["fwhm"])
    theirs = aperture.aperture_photometry(kept["pixels"], disc)["aperture_sum"].value - ring.mean * disc.area
    assert np.median(np.abs(level - ring.mean)) < 0.1 * np.median(noise)
    assert np.median(noise / ring.std) == pytest.approx(1.0, abs=0.02)
    bright = light > np.median(light)
    assert np.median(np.abs(light / theirs - 1.0)[bright]) < 0.01


def frames(n, **changed):
    """So many frames of one field, two minutes apart."""
    stars = replace(sky.stars_on_sky(*rendered(9)), **changed)
    return [
        NightFrame(f"{k}.fits", NOON + timedelta(minutes=2 * k), 30.0, (SIZE, SIZE), True, on_sky=stars)
        for k in range(n)
    ]


def dark(exposure_s=30.0, level=BLACK, kind="Dark Frame", **header):
    """A calibration frame as it is measured."""
    pixels = np.full((SIZE, SIZE), int(level), np.uint16)
    frame = Frame(pixels, hint=Hint(exposure_s=exposure_s), header={"IMAGETYP": kind, **header})
    return NightFrame("dark.fits", calibration=True, dark=sky.dark_level(frame))


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ([], False),
        ([dark()], True),
        ([dark(exposure_s=60.0)], False),
        ([dark(exposure_s=None)], False),
        ([dark(GAIN=300)], False),
        ([dark(kind="Flat Field")], False),
    ],
)
def test_black_is_that_of_a_dark_of_the_same_exposure_and_camera(given, found):
    night = night_of([*frames(2), *given])
    assert [one is not None for one in night.brightness] == [found, found]
    if found:
        assert night.usual(night.brightness).value == pytest.approx(SKY_MAG, abs=0.2)
    page = night_page(night, "lights")
    assert ("Sky brightness is not measured: the black level is unknown." in page) is not found
    assert ("Sky (mag/arcsec²)" in page) is found
    assert "Limiting magnitude" in page


def test_black_is_what_a_raw_file_states():
    assert all(night_of(frames(2, black=BLACK)).brightness)


def test_two_exposures_tell_black_where_sky_and_filter_are_one():
    short, long = frames(2)
    stars = short.on_sky
    rate = (np.median(stars.level) - BLACK) / 30.0
    less = replace(stars, level=stars.level - 25.0 * rate, light=stars.light / 6.0)
    pair = replace(short, on_sky=less, exposure_s=5.0), long
    for one in night_of(pair).brightness:
        assert one.value == pytest.approx(SKY_MAG, abs=0.3)
    apart = [
        replace(pair[0], on_sky=replace(less, filter="Ha")),
        replace(pair[0], time_utc=NOON - timedelta(hours=2)),
        replace(pair[0], on_sky=replace(less, centre=-less.centre)),
        replace(pair[0], exposure_s=20.0),
    ]
    for other in apart:
        assert not any(night_of([other, long]).brightness)
