"""What a night's frames measure, against frames and numbers whose truth is made here or by other programs."""

import shutil
import subprocess
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.detection.auto import AutoDetector
from kochab.frames import read_frame
from kochab.solver import SolveOptions
from kochab.workflows.night import drawings
from kochab.workflows.night.earlier import record_of
from kochab.workflows.night.frame import NightFrame, measure_frame
from kochab.workflows.night.page import night_page
from kochab.workflows.night.sharpness import CORNERS, LEAST_SNR, SIDES, field_of, night_field, sharpness
from kochab.workflows.night.summary import NO_TILT, advice_of, night_of
from kochab.workflows.night.table import night_json
from kochab.workflows.night.tracking import Place, tracking_of
from kochab.workflows.night.transparency import StarLight, losses
from tests.workflows.night_sky import drawn, scattered

SIZE = 900, 600


def measured(fwhm_of, seed=1, **look):
    xy, flux = scattered(SIZE, 160, seed)
    u, v = ((xy - (np.array(SIZE) - 1) / 2) / (np.hypot(*SIZE) / 2)).T
    pixels = drawn(SIZE, xy, flux, np.broadcast_to(fwhm_of(u, v), len(xy)), seed, **look)
    return sharpness(AutoDetector().detect(Frame(pixels)))


@pytest.mark.parametrize("fwhm", [2.2, 3.5, 6.0])
def test_fwhm_is_that_of_the_stars_drawn(fwhm):
    found = measured(lambda u, v: fwhm + 0 * u)
    assert found.fwhm_px.value == pytest.approx(fwhm, rel=0.03)
    assert 0 < found.fwhm_px.sigma < 0.03 * fwhm
    assert found.elongation.value < 1.06


@pytest.mark.parametrize(("across", "down", "corner"), [(0.8, 0.5, "lower right"), (-0.8, 0.5, "lower left"), (-0.6, -0.6, "upper left"), (0.6, -0.6, "upper right")])  # fmt: skip
def test_a_tilt_is_found_with_its_corner_and_size(across, down, corner):
    field = measured(lambda u, v: 3.6 + across * u + down * v).field
    assert field.softest == corner
    assert field.tilt_chance < 1e-9
    assert field.tilt.value == pytest.approx(2 * np.hypot(across, down), abs=4 * field.tilt.sigma + 0.06)
    assert abs(field.curvature.value) < 4 * field.curvature.sigma + 0.05
    assert max(field.corners, key=lambda name: field.corners[name].value) == corner


def test_curvature_is_not_taken_for_tilt():
    field = measured(lambda u, v: 3.0 + 1.2 * (u * u + v * v)).field
    assert field.curvature.value == pytest.approx(1.2, abs=4 * field.curvature.sigma + 0.06)
    assert field.tilt_chance > 1e-3


def test_even_fields_have_no_tilt_and_its_chance_means_what_it_says():
    fields = [measured(lambda u, v: 3.2 + 0 * u, seed).field for seed in range(12)]
    assert sum(field.tilt_chance < 0.05 for field in fields) <= 3
    assert min(field.tilt_chance for field in fields) > 1e-4
    night = night_field(fields)
    assert night.tilt_chance > 1e-3
    assert night.tilt.sigma < 0.5 * np.mean([field.tilt.sigma for field in fields])


@pytest.mark.parametrize(("own", "noise"), [(0.1, 0.0), (0.1, 0.05), (0.0, 0.1)])
def test_many_frames_of_the_same_stars_are_not_surer_than_the_stars(own, noise):
    """Each star's width is off by ``own`` px in all frames (a neighbour, its place in the pixel), by ``noise`` in each."""
    pulls = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        xy, widths = rng.uniform(0.0, 1.0, (120, 2)) * (3000, 2000), 3.0 + rng.normal(0.0, own, 120)
        night = night_field([field_of(xy, widths + rng.normal(0.0, noise, 120), (3000, 2000)) for _ in range(30)])
        assert night.tilt_chance > NO_TILT  # before, a quarter and more of such nights had a sure tilt
        pulls += list(night.terms[1:] / np.sqrt(np.diag(night.covariance)[1:]))
    assert 0.7 < np.sqrt(np.mean(np.square(pulls))) < 1.25
    assert np.mean(np.abs(pulls) < 2.0) > 0.9


def test_a_night_keeps_the_tilt_that_its_frames_share_while_focus_changes():
    fields = [measured(lambda u, v, f=focus: f + 0.5 * u, int(10 * focus)).field for focus in (2.8, 3.4, 4.2)]
    night = night_field(fields)
    assert night.tilt.value == pytest.approx(1.0, abs=min(4 * night.tilt.sigma, 0.15))
    assert night.tilt.sigmas > 5


@pytest.mark.parametrize("angle_deg", [20.0, 110.0])
def test_a_trail_is_told_with_its_direction_and_round_stars_have_none(angle_deg):
    found = measured(lambda u, v: 3.4 + 0 * u, stretch=1.4, angle_deg=angle_deg)
    assert found.trail.value == pytest.approx(0.4, abs=0.07)
    assert (found.trail_deg - angle_deg + 90) % 180 - 90 == pytest.approx(0, abs=4)
    round_ones = measured(lambda u, v: 3.4 + 0 * u)
    assert round_ones.trail.value < max(3 * round_ones.trail.sigma, 0.01)


# -- The same frames by other programs -------------------------------------------------------------


def by_source_extractor(pixels, folder, threshold):
    """FWHM, elongation and angle of its clear stars (N, 3), px and degrees."""
    from astropy.io import fits

    fits.writeto(folder / "frame.fits", pixels.astype(np.float32))
    (folder / "out.param").write_text("FWHM_IMAGE\nELONGATION\nTHETA_IMAGE\nFLAGS\nSNR_WIN\n")
    (folder / "none.conv").write_text("CONV NORM\n0 0 0\n0 1 0\n0 0 0\n")
    words = ["-CATALOG_NAME", "out.txt", "-CATALOG_TYPE", "ASCII", "-PARAMETERS_NAME", "out.param", "-FILTER_NAME"]
    words += ["none.conv", "-DETECT_THRESH", threshold, "-SATUR_LEVEL", "60000"]
    command = ["source-extractor", "frame.fits", "-c", "/dev/null", *words]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    rows = np.loadtxt(folder / "out.txt")
    return rows[(rows[:, 3] == 0) & (rows[:, 4] > LEAST_SNR)][:, :3]


@pytest.mark.skipif(not shutil.which("source-extractor"), reason="no source-extractor here")
@pytest.mark.parametrize("fwhm", [3.0, 4.5])
def test_source_extractor_sees_the_same_width_and_roundness(fwhm, tmp_path):
    xy, flux = scattered(SIZE, 160, 5)
    pixels = drawn(SIZE, xy, flux, np.full(160, fwhm), 5, stretch=1.25, angle_deg=30.0)
    rows = by_source_extractor(pixels, tmp_path, "1.5")
    found = sharpness(AutoDetector().detect(Frame(pixels)))
    assert len(rows) > 80
    assert found.fwhm_px.value == pytest.approx(float(np.median(rows[:, 0])), rel=0.08)
    assert found.elongation.value == pytest.approx(float(np.median(rows[:, 1])), rel=0.05)
    assert found.trail_deg == pytest.approx(float(np.median(rows[:, 2])), abs=5)


@pytest.mark.skipif(not shutil.which("source-extractor"), reason="no source-extractor here")
@pytest.mark.parametrize("name", ["geo__AG_Peg-0004V.fit", "geo__RW_Aur-0004V.fit", "pan__19980-fine-final.fits"])
def test_source_extractor_sees_the_same_in_real_frames(name, repository, tmp_path):
    path = repository.parent / "shared" / "frames" / name
    if not path.exists():
        pytest.skip("no real frames here")
    frame = read_frame(path)
    rows = by_source_extractor(frame.pixels, tmp_path, "5")
    found = sharpness(AutoDetector().detect(frame))
    assert found.fwhm_px.value == pytest.approx(float(np.median(rows[:, 0])), rel=0.1)
    assert found.elongation.value == pytest.approx(float(np.median(rows[:, 1])), rel=0.1)


def fitted_width():
    """photutils' fit of a star's width, which it has since 2.0."""
    from photutils import psf

    return getattr(psf, "fit_fwhm", None) or pytest.skip("this photutils fits no width")


@pytest.mark.parametrize("name", ["apt2032.fits", "pan__19980-fine-final.fits", "exo__HATP-32171220013343.FITS"])
def test_photutils_sees_the_same_width_in_real_frames(name, repository):
    fit_fwhm = fitted_width()

    path = repository.parent / "shared" / "frames" / name
    if not path.exists():
        pytest.skip("no real frames here")
    frame = read_frame(path)
    detections = AutoDetector().detect(frame)
    good = ~detections.saturated & ~detections.blended & (detections.snr > 50)
    stars = detections.take(np.flatnonzero(good)[:40])
    if len(stars) < 8:
        pytest.skip("fewer than eight clear stars")
    pixels = frame.pixels.astype(float) - detections.background
    theirs = fit_fwhm(pixels, xypos=stars.xy, fit_shape=(15, 15))
    ours = sharpness(detections)
    assert ours.fwhm_px.value == pytest.approx(float(np.median(theirs)), rel=0.15)


SEIZA = {
    (0.8, 0.5): {"upper left": 1.7917, "upper right": 2.1999, "lower left": 1.9686, "lower right": 2.3849},
    (-0.8, 0.5): {"upper left": 2.1982, "upper right": 1.7937, "lower left": 2.3758, "lower right": 1.9438},
    (-0.6, -0.6): {"upper left": 2.3349, "upper right": 2.0279, "lower left": 2.1260, "lower right": 1.8259},
    (0.6, -0.6): {"upper left": 2.0073, "upper right": 2.3320, "lower left": 1.8191, "lower right": 2.1141},
}
"""Half-flux radii, px, that seiza 0.45.0 (PyPI, Apache-2.0) tells of the corners of a 3 x 3 grid over these frames:
``tilt_analysis(detect_measured_stars(pixels, noise_reduction_radius=0, detection_binning=1))``."""


@pytest.mark.parametrize(("k", "slope"), list(enumerate(SEIZA)))
def test_seiza_finds_the_same_corners_soft_and_sharp(k, slope):
    size = (1800, 1200)
    xy, flux = scattered(size, 600, 30 + k)
    u, v = ((xy - (np.array(size) - 1) / 2) / (np.hypot(*size) / 2)).T
    pixels = drawn(size, xy, flux * 1.5, 3.6 + slope[0] * u + slope[1] * v, 30 + k)
    field = sharpness(AutoDetector().detect(Frame(pixels))).field
    theirs = SEIZA[slope]
    if find_spec("seiza"):
        import seiza

        found = seiza.detect_measured_stars(pixels.astype(np.uint16), noise_reduction_radius=0, detection_binning=1)
        _, tilt = seiza.tilt_analysis(found)
        names = {"top": "upper", "bottom": "lower"}
        now = dict(tilt.corners)
        theirs = {f"{names[name.split('-')[0]]} {name.split('-')[1]}": value for name, value in now.items()}
    ours = {name: field.at(*(field.corner * at * 2 / 3)).value for at, name in CORNERS.items()}
    assert sorted(ours, key=ours.get) == sorted(theirs, key=theirs.get)
    ratios = np.array([ours[name] / theirs[name] for name in ours])
    np.testing.assert_allclose(ratios, ratios.mean(), rtol=0.05)


def test_photutils_sees_the_same_tilt_in_a_real_frame(repository):
    fit_fwhm = fitted_width()

    path = repository.parent / "shared" / "frames" / "exo__HATP-32171220013343.FITS"
    if not path.exists():
        pytest.skip("needs the shared frames")
    frame = read_frame(path)
    detections = AutoDetector().detect(frame)
    field = sharpness(detections).field
    clear = ~detections.saturated & ~detections.blended & (detections.snr > 30)
    stars = detections.take(np.flatnonzero(clear)[:200])
    pixels = frame.pixels.astype(float) - detections.background
    width = fit_fwhm(pixels, xypos=stars.xy, fit_shape=(11, 11))
    size = np.array([frame.width, frame.height])
    u, v = ((stars.xy - (size - 1) / 2) / (np.hypot(*size) / 2)).T
    rows = np.stack([np.ones(len(u)), u, v, u * u + v * v], axis=1)
    kept = np.abs(width - np.median(width)) < 1.0
    for _ in range(6):
        terms = np.linalg.lstsq(rows[kept], width[kept], rcond=None)[0]
        left = width - rows @ terms
        kept = np.abs(left) < 4.0 * np.std(left[kept])
    assert SIDES[round(np.degrees(np.arctan2(terms[2], terms[1])) / 45) % 8] == field.softest
    assert 2.0 * np.hypot(*terms[1:3]) == pytest.approx(field.tilt.value, abs=2.0 * np.hypot(field.tilt.sigma, 0.02))


needs_psfex = pytest.mark.skipif(
    not (shutil.which("psfex") and shutil.which("source-extractor")), reason="needs psfex and source-extractor"
)


def by_psfex(pixels, folder):
    """FWHM in the corners of PSFEx's model of the star image, which varies linearly over the frame, fitted here.

    The model is as wide as what is fitted: one of 25 px takes PSFEx 48 s in place of 17 for a frame of 1000 stars.
    """
    from astropy.io import fits

    fit_fwhm = fitted_width()

    fits.writeto(folder / "frame.fits", pixels.astype(np.float32))
    (folder / "out.param").write_text(
        "VIGNET(17,17)\nX_IMAGE\nY_IMAGE\nFLUX_RADIUS\nSNR_WIN\nFLUX_APER(1)\nFLUXERR_APER(1)\nELONGATION\nFLAGS\nFLUX_MAX\n"
    )
    (folder / "none.conv").write_text("CONV NORM\n0 0 0\n0 1 0\n0 0 0\n")
    call = partial(subprocess.run, cwd=folder, check=True, capture_output=True)
    call(
        [
            "source-extractor",
            "frame.fits",
            "-c",
            "/dev/null",
            "-CATALOG_NAME",
            "out.cat",
            "-CATALOG_TYPE",
            "FITS_LDAC",
            "-PARAMETERS_NAME",
            "out.param",
            "-FILTER_NAME",
            "none.conv",
            "-DETECT_THRESH",
            "3",
            "-PHOT_APERTURES",
            "18",
            "-SATUR_LEVEL",
            "65000",
        ]
    )
    call(
        [
            "psfex",
            "out.cat",
            "-c",
            "/dev/null",
            "-PSFVAR_KEYS",
            "X_IMAGE,Y_IMAGE",
            "-PSFVAR_GROUPS",
            "1,1",
            "-PSFVAR_DEGREES",
            "1",
            "-PSF_SAMPLING",
            "1",
            "-PSF_SIZE",
            "17,17",
            "-SAMPLE_FWHMRANGE",
            "2,10",
            "-SAMPLE_VARIABILITY",
            "0.9",
            "-CHECKPLOT_TYPE",
            "NONE",
            "-CHECKIMAGE_TYPE",
            "NONE",
            "-WRITE_XML",
            "N",
        ]
    )
    with fits.open(folder / "out.psf") as file:
        head, model = file[1].header, file[1].data["PSF_MASK"][0]
    height, width = pixels.shape
    theirs = {}
    for name, place in {
        "upper left": (0, 0),
        "upper right": (width - 1, 0),
        "lower left": (0, height - 1),
        "lower right": (width - 1, height - 1),
    }.items():
        x, y = ((place[k] + 1 - head[f"POLZERO{k + 1}"]) / head[f"POLSCAL{k + 1}"] for k in (0, 1))
        star = model[0] + x * model[1] + y * model[2]
        theirs[name] = float(fit_fwhm(star, xypos=(8, 8), fit_shape=(17, 17))[0])
    return theirs


@needs_psfex
def test_psfex_finds_the_same_corner_and_the_same_widths_there(tmp_path):
    xy, flux = scattered(SIZE, 260, 3)
    u, v = ((xy - (np.array(SIZE) - 1) / 2) / (np.hypot(*SIZE) / 2)).T
    pixels = drawn(SIZE, xy, flux * 1.5, 4.0 - 0.9 * u + 0.6 * v, 3)
    theirs = by_psfex(pixels, tmp_path)
    field = sharpness(AutoDetector().detect(Frame(pixels))).field
    ours = {name: one.value for name, one in field.corners.items()}
    assert field.softest == "lower left"
    assert sorted(ours, key=ours.get) == sorted(theirs, key=theirs.get)
    # Resampling widens the narrowest of its stars by a tenth.
    assert list(ours.values()) == pytest.approx([theirs[name] for name in ours], rel=0.13)


@needs_psfex
@pytest.mark.parametrize("name", ["exo__HATP-32171220013343.FITS", "gran__polar_30sec.jpg"])
def test_psfex_sees_the_same_tilt_in_real_frames(name, repository, tmp_path):
    """In frames whose tilt has a chance below 1 in 5000: the same way, and as large to a half."""
    path = repository.parent / "shared" / "frames" / name
    if not path.exists():
        pytest.skip("needs the shared frames")
    frame = read_frame(path)
    field = sharpness(AutoDetector().detect(frame)).field
    assert field.tilt_chance < 2e-4

    def across_and_down(corners):
        left, right = (sum(corners[f"{row} {side}"] for row in ("upper", "lower")) / 2 for side in ("left", "right"))
        upper, lower = (sum(corners[f"{row} {side}"] for side in ("left", "right")) / 2 for row in ("upper", "lower"))
        return np.array([right - left, lower - upper])

    ours = across_and_down({name: one.value for name, one in field.corners.items()})
    theirs = across_and_down(by_psfex(np.asarray(frame.pixels, dtype=np.float64), tmp_path))
    assert ours @ theirs > 0.8 * np.linalg.norm(ours) * np.linalg.norm(theirs)
    assert 0.5 < np.linalg.norm(ours) / np.linalg.norm(theirs) < 1.5


@pytest.mark.parametrize(("minutes", "least"), [(2, 2), (45, 4), (540, 4)])
def test_a_night_however_short_has_times_below_its_drawings(minutes, least):
    drawn_text = drawings._times(datetime(2026, 1, 1, 20, 0, 30, tzinfo=UTC), (0.0, minutes / 60), 10.0)
    assert drawn_text.count('class="time"') >= least


# -- Transparency ----------------------------------------------------------------------------------


def light_of(rng, stars, own, lost, noise=0.03):
    return StarLight(
        tuple(stars), own + rng.normal(0, noise, len(own)) + 21.0 - lost, np.full(len(own), noise)
    )  # fmt: skip


def test_the_light_lost_is_what_was_taken_and_its_uncertainty_holds():
    rng = np.random.default_rng(3)
    pulls = []
    for _ in range(30):
        own, lost = rng.normal(0, 0.3, 25), np.abs(rng.normal(0, 0.4, 12))
        names = [f"s{k}" for k in range(25)]
        found = losses([light_of(rng, names, own, one) for one in lost])
        clear = int(np.argmin([one.value**2 for one in found]))
        pulls += [
            (one.value - (true - lost[clear])) / one.sigma
            for one, true in zip(found, lost, strict=True)
            if one.sigma > 0
        ]
    assert 0.7 < np.std(pulls) < 1.3
    assert np.mean(np.abs(pulls) < 2) > 0.9


def test_fields_without_common_stars_are_less_certain_but_right():
    rng = np.random.default_rng(4)
    pulls = []
    for _ in range(40):
        one = light_of(rng, [f"a{k}" for k in range(30)], rng.normal(0, 0.25, 30), 0.0)
        other = light_of(rng, [f"b{k}" for k in range(30)], rng.normal(0, 0.25, 30), 0.7)
        found = losses([one, other])
        step = found[1].value - found[0].value
        sigma = max(found[0].sigma, found[1].sigma)
        assert sigma > 0.04
        pulls.append((step - 0.7) / sigma)
    assert 0.6 < np.std(pulls) < 1.5


def test_a_variable_and_a_wrong_match_do_not_pull_a_frame_and_too_few_stars_say_nothing():
    rng = np.random.default_rng(5)
    names, own = [f"s{k}" for k in range(20)], rng.normal(0, 0.2, 20)
    frames = [light_of(rng, names, own, lost) for lost in (0.0, 0.0, 0.5, 0.0)]
    frames[3].excess_mag[4] -= 2.0
    found = losses([*frames, light_of(rng, names[:2], own[:2], 0.0)])
    assert found[3].value == pytest.approx(0.0, abs=0.06)
    assert found[2].value == pytest.approx(0.5, abs=0.06)
    assert found[4] is None


# -- Tracking --------------------------------------------------------------------------------------

START = datetime(2026, 1, 1, 20, tzinfo=UTC)


def held(rng, drift_arcsec_h, count=20, noise=1.5, ra=359.999, dec=60.0, minutes=5.0, dithers=()):
    hours = np.arange(count) * minutes / 60
    east = drift_arcsec_h[0] * hours + rng.normal(0, noise, count)
    north = drift_arcsec_h[1] * hours + rng.normal(0, noise, count)
    for at in dithers:
        east[at:] += 40.0
        north[at:] -= 25.0
    return [
        Place(START + timedelta(hours=float(h)), float((ra + e / 3600 / np.cos(np.radians(dec))) % 360), float(dec + n / 3600), 1.0)
        for h, e, n in zip(hours, east, north, strict=True)
    ]  # fmt: skip


def test_the_drift_is_found_across_0h_and_its_uncertainty_holds():
    rng = np.random.default_rng(6)
    for count in (4, 8, 25):
        pulls = []
        for _ in range(150):
            (found,) = tracking_of(held(rng, (12.0, -30.0), count))
            pulls += [
                (found.ra_arcsec_h.value - 12.0) / found.ra_arcsec_h.sigma,
                (found.dec_arcsec_h.value + 30.0) / found.dec_arcsec_h.sigma,
            ]
        assert 0.58 < np.mean(np.abs(pulls) < 1) < 0.8, count
        assert np.mean(np.abs(pulls) < 2) > 0.83, count


def test_dithers_are_no_drift_and_another_field_is_another_drift():
    rng = np.random.default_rng(7)
    places = held(rng, (6.0, 4.0), 24, dithers=(6, 12, 18))
    later = [
        Place(p.time_utc + timedelta(hours=3), 120.0 + p.ra_deg % 1e-9, p.dec_deg - 30, 1.0)
        for p in held(rng, (0.0, 50.0), 12)
    ]
    found = tracking_of([*later, *places])
    assert [len(one.frames) for one in found] == [24, 12]
    assert found[0].dithers == 3
    assert found[0].dec_arcsec_h.value == pytest.approx(4.0, abs=4 * found[0].dec_arcsec_h.sigma)
    assert found[0].dec_arcsec_h.sigma < 3.0
    assert found[1].dec_arcsec_h.value == pytest.approx(50.0, abs=4 * found[1].dec_arcsec_h.sigma)


def knocked(places, at, east=0.0, north=0.0, roll=0.0):
    """The places, displaced from one on, arcsec."""
    moved = [
        replace(p, ra_deg=(p.ra_deg + east / 3600 / np.cos(np.radians(p.dec_deg))) % 360, dec_deg=p.dec_deg + north / 3600,
                roll_deg=p.roll_deg + roll)
        for p in places[at:]
    ]  # fmt: skip
    return [*places[:at], *moved]


@pytest.mark.parametrize("dithers", [(), (3, 6, 9, 12, 15, 18, 21), tuple(range(1, 24))])
def test_a_slipped_clutch_is_told_with_its_axis_and_size_and_dithers_are_not(dithers):
    rng = np.random.default_rng(21)
    places = held(rng, (6.0, -4.0), 24, minutes=3.0)
    for at in dithers:  # as programs do: a new place in a square about the first
        east, north = rng.uniform(-20, 20, 2)
        places = [*places[:at], knocked(places[at : at + 1], 0, east, north)[0], *places[at + 1 :]]
    assert [jump for one in tracking_of(places) for jump in one.knocks] == []
    (found,) = tracking_of(knocked(places, 14, east=-300.0))
    (jump,) = found.knocks
    assert (jump.before, jump.after, jump.axis) == (13, 14, "RA")
    assert jump.ra_arcsec.value == pytest.approx(-300.0, abs=4 * jump.ra_arcsec.sigma + 1)
    assert "clutch" in jump.words
    frames = [
        NightFrame(f"{k}", p.time_utc, 5.0, SIZE, True, ra_deg=p.ra_deg, dec_deg=p.dec_deg, roll_deg=0.0, width_deg=1.0)
        for k, p in enumerate(knocked(places, 14, east=-300.0))
    ]  # fmt: skip
    night = night_of(frames)
    assert [(event.kind, event.time_utc) for event in night.events] == [("jump", places[14].time_utc)]
    assert "Tighten the RA clutch" in advice_of(night)


def test_a_frame_exposed_through_a_slip_makes_one_event_and_a_flip_is_no_slip():
    places = held(np.random.default_rng(22), (0.0, 0.0), 20)
    (found,) = tracking_of(knocked(knocked(places, 9, north=100.0), 10, north=150.0))
    (jump,) = found.knocks
    assert (jump.axis, jump.dec_arcsec.value) == ("Dec", pytest.approx(250.0, abs=12))
    (found,) = tracking_of(knocked(places, 9, east=200.0, north=300.0, roll=179.6))
    assert found.knocks == ()
    assert [str(jump.kind) for jump in found.jumps] == ["flip"]


def test_a_missing_frame_is_no_dither():
    places = held(np.random.default_rng(12), (90.0, -40.0), 16, noise=0.7)
    (found,) = tracking_of(places[:7] + places[9:])
    assert found.dithers == 0
    assert found.ra_arcsec_h.value == pytest.approx(90.0, abs=4 * found.ra_arcsec_h.sigma)


def test_half_a_turn_of_the_worm_is_not_told_as_a_sure_drift():
    hours = np.arange(20) / 60 * 0.25
    wave = 8.0 * np.sin(2 * np.pi * hours * 60 / 8)
    places = [Place(START + timedelta(hours=float(h)), 100 + float(w) / 3600, 0.0, 1.0) for h, w in zip(hours, wave, strict=True)]  # fmt: skip
    (found,) = tracking_of(places)
    assert found.ra_arcsec_h.sigmas < 5


def test_a_drift_that_is_all_uncertainty_is_unknown_and_no_number_breaks_over_a_line():
    rng = np.random.default_rng(12)
    short, long = held(rng, (40.0, -20.0), 8, noise=15.0, minutes=0.25), held(rng, (40.0, -20.0), 8, minutes=10.0)

    def page_of(places):
        one = measured(lambda u, v: 3.4 + 0 * u)
        seen = {"solved": True, "width_deg": 2.0, "sharp": one}
        frames = [
            NightFrame(f"{k}", p.time_utc, 5.0, SIZE, ra_deg=p.ra_deg, dec_deg=p.dec_deg, **seen)
            for k, p in enumerate(places)
        ]
        night = night_of(frames)
        return night, night_page(night, "lights")

    night, page = page_of(short)
    assert night.tracking[0].ra_arcsec_h.sigma > 200.0
    assert (night.tracking[0].drifts, night.tracking[0].rate) == ((None, None), None)
    assert "<b>unknown</b><span>2 min is too short</span>" in page
    assert "<td>2\u00a0min</td><td>unknown</td><td>unknown</td>" in page
    assert not {"ra_arcsec_h", "dec_arcsec_h"} & set(record_of(night).values)
    night, page = page_of(long)
    assert "<td>1\u00a0h\u00a010\u00a0min</td><td>+" in page
    assert {"ra_arcsec_h", "dec_arcsec_h"} <= set(record_of(night).values)
    assert "\u00a0±\u00a0" in page
    assert " ± " not in page


@pytest.mark.parametrize("count", [6, 20])
def test_wander_has_an_uncertainty_that_holds(count):
    """Of white scatter of 1.5 arcsec, in fields of few and of many frames."""
    rng = np.random.default_rng(13)
    found = [one for _ in range(200) for one in tracking_of(held(rng, (6.0, -4.0), count))]
    pulls = np.array([(wander.value - 1.5) / wander.sigma for one in found for wander in one.wander_arcsec])
    assert 0.55 < np.mean(np.abs(pulls) < 1.0) < 0.85
    assert np.mean(np.abs(pulls) < 2.0) > 0.9


def test_a_mount_that_does_not_track_is_told_and_no_guiding_is_blamed():
    rng = np.random.default_rng(9)
    sidereal = 15.041 * 3600 * np.cos(np.radians(60))
    standing = held(rng, (sidereal, 0.0), 8, minutes=0.5)
    assert [one.untracked for one in tracking_of(standing)] == [True]
    assert [one.untracked for one in tracking_of(held(rng, (600.0, 300.0), 8))] == [False]
    round_ones = measured(lambda u, v: 3.4 + 0 * u, stretch=1.4)
    assert (
        tracking_of([*standing[:3], *(replace(p, time_utc=p.time_utc + timedelta(days=1)) for p in standing[:3])]) == []
    )
    frames = [
        NightFrame(f"{k}", p.time_utc, 5.0, SIZE, True, ra_deg=p.ra_deg, dec_deg=p.dec_deg, width_deg=20.0, sharp=round_ones)
        for k, p in enumerate(standing)
    ]  # fmt: skip
    assert "did not track" in advice_of(night_of(frames))
    trailed = measured(lambda u, v: 3.4 + 0.8 * u, stretch=1.4)  # a fixed tripod's wide field: longer at lower Dec
    night = night_of([replace(f, sharp=trailed) for f in frames])
    assert "tilt can&#x27;t be told" in night_page(night, "lights")
    assert night.shape.tilt.sigmas > 10.0  # the number is there, and says nothing of the sensor
    kept, as_json = record_of(night), night_json(night)
    assert "tilt_px" not in kept.values
    for row in as_json["frames"]:
        assert (row["tilt_px"], row["tilt_px_sigma"], row["softest"], row["curvature_px"]) == (None, None, None, None)
    assert as_json["field"] is None
    assert "Corners against the middle" not in night_page(night, "lights")
    assert "Corners against the middle" in night_page(
        night_of([replace(f, ra_deg=5.0) for f in night.frames]), "lights"
    )
    tracked = night_of([replace(f, sharp=trailed, ra_deg=5.0) for f in frames])
    assert "tilt_px" in record_of(tracked).values
    assert night_json(tracked)["field"]["softest"] == night_json(tracked)["frames"][0]["softest"] == "right"
    # near the pole the sky is slow: frames of turned bolts scatter by more in a quarter of an hour
    rng = np.random.default_rng(10)
    near_pole = [one for _ in range(200) for one in tracking_of(held(rng, (0.0, 0.0), 4, noise=200.0, dec=88.7))]
    assert np.mean([one.ra_arcsec_h.value > sidereal / 44.0 for one in near_pole]) > 0.1
    assert np.mean([one.untracked for one in near_pole]) < 0.03
    frames[-1] = replace(frames[-1], time_utc=START + timedelta(days=2))
    assert "several nights" in advice_of(night_of(frames))


def test_a_picture_has_its_time_of_what_sharpcap_wrote_beside_it(tmp_path):
    pixels = np.random.default_rng(2).integers(0, 20, (200, 300), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    (tmp_path / "a.CameraSettings.txt").write_text("[ZWO]\nExposure=3\nTimeStamp=2021-05-30T22:31:15.5Z\n")
    found = run(measure_frame(str(tmp_path / "a.png"), SolveOptions(timeout_s=0.5)))
    assert found.time_utc == datetime(2021, 5, 30, 22, 31, 15, 500000, UTC)


def test_three_frames_say_no_drift():
    assert tracking_of(held(np.random.default_rng(8), (5.0, 5.0), 3)) == []
