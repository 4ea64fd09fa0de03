"""The published detectors: what they find on rendered fields, and that any frame is an answer."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.errors import UsageError
from kochab.core.frame import Frame
from kochab.detection import DETECTORS
from kochab.simulate.star_images import RenderedStar, Sensor, Sky
from tests.detection.fields import compare, field

NAMES = [name for name in DETECTORS if name != "auto"]
PER_STAR = ("flux", "snr", "fwhm_px", "elongation", "angle_rad", "saturated", "blended")
FLAT_SKY = Sky(400.0)


@pytest.fixture(scope="module")
def plain():
    return field(sky=FLAT_SKY)


@pytest.mark.parametrize(
    ("name", "completeness", "error_px"),
    [
        ("clusters", 0.9, 0.06),
        ("gaussian", 1.0, 0.04),
        ("peaks", 1.0, 0.35),
        ("contours", 0.97, 0.15),
        ("thesis", 1.0, 0.04),
        ("daostarfinder", 0.97, 0.06),
        ("irafstarfinder", 0.97, 0.12),
    ],
)
def test_a_plain_field_is_found(plain, name, completeness, error_px) -> None:
    frame, xy, _ = plain
    complete, pure, error = compare(DETECTORS.make(name).detect(frame), xy)
    assert complete >= completeness
    assert pure == 1.0
    assert error < error_px


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bayer", [None, "RGGB"])
def test_detections_are_well_formed_and_the_brightest_come_first(name, bayer) -> None:
    frame, xy, flux = field(sky=FLAT_SKY, sensor=Sensor(bayer=bayer))
    found = DETECTORS.make(name).detect(frame)
    assert (found.width, found.height) == (frame.width, frame.height)
    assert all(len(getattr(found, part)) == len(found) for part in PER_STAR)
    if name != "clusters":
        assert (np.diff(found.flux) <= 0).all()
    assert (found.snr > 3).all()
    assert found.background == pytest.approx(500, abs=120 if bayer else 2)
    brightest = xy[np.argsort(-flux)[:10]]
    away = np.hypot(*(found.xy[:10, None] - brightest).transpose(2, 0, 1)).min(axis=1)
    # DAOStarFinder judges sharpness, which the chequers of a mosaic spoil.
    assert (away < 2).sum() >= (5 if bayer and name == "daostarfinder" else 7)
    if bayer:
        assert np.isnan(found.fwhm_px).all()
    else:
        assert np.nanmedian(found.fwhm_px) == pytest.approx(3.0, abs=0.2)
        assert found.noise == pytest.approx(20.6, rel=0.05)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((0, 0)),
        np.zeros((1, 1)),
        np.zeros((7, 300)),
        np.zeros((64, 64), np.uint8),
        np.full((64, 64), 65535, np.uint16),
        np.full((40, 40), np.nan),
        np.full((40, 40), np.inf),
        np.zeros((64, 64), bool),
        np.zeros((8, 8), np.int32),
    ],
)
def test_frames_without_stars_are_an_answer(name, pixels) -> None:
    assert len(DETECTORS.make(name).detect(Frame(pixels))) == 0


DTYPES = (np.uint8, np.int16, np.uint16, ">u2", np.int32, np.uint32, np.float16, np.float32, np.float64)


@pytest.mark.parametrize(
    ("name", "dtype"),
    [(name, dtype) for k, name in enumerate(NAMES) for dtype in (DTYPES[k % 3 :: 3] if k else DTYPES)],
)
def test_any_kind_of_number(plain, name, dtype) -> None:
    frame, xy, _ = plain
    small = np.clip(frame.pixels / 16.0, 0, 255) if dtype == np.uint8 else frame.pixels // 4
    found = DETECTORS.make(name).detect(Frame(small.astype(dtype)))
    complete, pure, _ = compare(found, xy)
    assert complete > 0.75
    assert pure > 0.95


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("daostarfinder", "irafstarfinder")])
def test_a_picture_of_two_values(name) -> None:
    pixels = np.zeros((64, 64), bool)
    pixels[20:24, 30:34] = True
    pixels[50:54, 10:14] = True
    found = DETECTORS.make(name).detect(Frame(pixels))
    np.testing.assert_allclose(np.sort(found.xy[:, 0]), [11.5, 31.5], atol=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_not_a_number_is_left_aside(plain, name) -> None:
    frame, xy, _ = plain
    pixels = frame.pixels.astype(np.float32)
    pixels[:, :60] = np.nan
    pixels[200, 300:310] = np.inf
    found = DETECTORS.make(name).detect(Frame(pixels))
    complete, pure, _ = compare(found, xy[xy[:, 0] > 65])
    assert complete > 0.85
    assert pure > 0.95
    assert np.isfinite(found.xy).all()
    assert np.isfinite(found.flux).all()


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_found_in_noise_alone_or_a_handful(name) -> None:
    pixels = np.random.default_rng(3).normal(500, 20, (480, 640)).astype(np.uint16)
    assert len(DETECTORS.make(name).detect(Frame(pixels))) <= 2


@pytest.mark.parametrize("name", [name for name in NAMES if name != "thesis"])
def test_no_more_than_asked_for(plain, name) -> None:
    every = DETECTORS.make(name).detect(plain[0])
    few = DETECTORS.make(name, max_stars=7).detect(plain[0])
    np.testing.assert_array_equal(few.xy, every.xy[:7])


@pytest.mark.parametrize("name", NAMES)
def test_stars_that_clip_are_marked(name) -> None:
    frame, _, _ = field(sky=FLAT_SKY, sensor=Sensor(saturation=3000.0))
    found = DETECTORS.make(name).detect(frame)
    assert 0.1 < found.saturated.mean() < 0.9
    assert not DETECTORS.make(name).detect(replace(frame, saturation=None)).saturated.any()


def test_a_cluster_reaches_as_far_as_tau_and_its_centre_moves() -> None:
    pixels = np.zeros((40, 40), np.uint8)
    pixels[10, 5:25] = 100  # one row of 20 pixels; its centre stays half way behind
    found = DETECTORS.make("clusters", tau_px=30, threshold=51).detect(Frame(pixels))
    np.testing.assert_allclose(found.xy, [[14.5, 10.0]])
    assert found.flux[0] == 2000
    two = DETECTORS.make("clusters", tau_px=8, threshold=51, least_pixels=1).detect(Frame(pixels))
    np.testing.assert_allclose(two.xy, [[12.5, 10.0], [22.5, 10.0]])  # 21 is 8.5 from the middle of 5..20
    assert not len(DETECTORS.make("clusters", tau_px=8, threshold=101).detect(Frame(pixels)))


def test_clusters_rank_by_pixels_as_the_paper_or_by_flux() -> None:
    pixels = np.zeros((40, 40), np.uint8)
    pixels[5:9, 5:10] = 60
    pixels[25:28, 25:29] = 250
    wide, bright = [7.0, 6.5], [26.5, 26.0]
    make = DETECTORS.make
    np.testing.assert_allclose(make("clusters", threshold=51).detect(Frame(pixels)).xy[0], wide)
    found = make("clusters", threshold=51, rank="flux").detect(Frame(pixels))
    np.testing.assert_allclose(found.xy[0], bright)


def test_a_flat_top_is_one_peak_and_a_refined_one_is_between_pixels(plain) -> None:
    pixels = np.zeros((40, 40), np.uint16)
    pixels[10:13, 10:14] = 60000
    np.testing.assert_allclose(DETECTORS.make("peaks").detect(Frame(pixels)).xy, [[11.5, 11.0]])
    frame, xy, _ = plain
    errors = [compare(DETECTORS.make("peaks", refined=refined).detect(frame), xy)[2] for refined in (False, True)]
    assert errors[1] < 0.4 * errors[0]


def test_the_gaussian_misses_trails_that_peaks_and_contours_find() -> None:
    frame, xy, _ = field(RenderedStar(3.0, trail_px=(8.0, 3.0)), FLAT_SKY)
    complete = {
        name: compare(DETECTORS.make(name).detect(frame), xy, 4.0)[0] for name in ("gaussian", "peaks", "contours")
    }
    assert complete["gaussian"] < 0.6 < min(complete["peaks"], complete["contours"])


def test_the_thesis_takes_peaks_where_fewer_than_five_gaussians_are_found(plain) -> None:
    same = DETECTORS.make("gaussian").detect(plain[0]).xy
    np.testing.assert_array_equal(DETECTORS.make("thesis").detect(plain[0]).xy, same)
    trailed, _, _ = field(RenderedStar(3.0, trail_px=(30.0, 0.0)), FLAT_SKY, n=12, faintest=30000)
    assert len(DETECTORS.make("gaussian").detect(trailed)) < 5
    found = DETECTORS.make("thesis").detect(trailed)
    np.testing.assert_array_equal(found.xy, DETECTORS.make("peaks").detect(trailed).xy)
    assert len(found) > 5


@pytest.mark.parametrize("name", ["gaussian", "peaks", "contours"])
def test_bright_stars_raise_the_threshold_unless_the_spread_is_clipped(name) -> None:
    frame, xy, _ = field(sky=FLAT_SKY)
    pixels = frame.pixels.copy()
    pixels[100:130, 100:140] = 65535
    found = [len(DETECTORS.make(name, clipped=clipped).detect(Frame(pixels))) for clipped in (False, True)]
    assert found[0] < 0.3 * len(xy) < 0.85 * len(xy) < found[1]


@pytest.mark.parametrize("name", ["gaussian", "thesis", "daostarfinder", "irafstarfinder"])
def test_without_photutils_its_detectors_say_what_to_install(name, plain, monkeypatch):
    monkeypatch.setitem(sys.modules, "photutils.detection", None)
    with pytest.raises(UsageError, match=r"pip install photutils"):
        DETECTORS.make(name).detect(plain[0])


def test_nothing_else_needs_photutils(repository):
    """A frame is solved, and every detector but those two finds its stars, with photutils blocked."""
    code = (
        "import sys; sys.modules['photutils'] = None\n"
        "from kochab.__main__ import main\n"
        "from kochab.detection import DETECTORS\n"
        "from kochab.frames import read_frame\n"
        "file = 'resources/samples/pleiades.fits'\n"
        "for name in set(DETECTORS) - {'gaussian', 'thesis', 'daostarfinder', 'irafstarfinder'}:\n"
        "    assert len(DETECTORS.make(name).detect(read_frame(file))), name\n"
        "sys.exit(main(['solve', file]))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout + done.stderr
