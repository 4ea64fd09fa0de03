"""The default detector on rendered fields: what it finds, where, and how large."""

import numpy as np
import pytest

from kochab.core.errors import UsageError
from kochab.core.frame import Frame
from kochab.detection import DETECTORS
from kochab.simulate.star_images import RenderedStar, Sensor, Sky, render

from .fields import SIZE, compare, detect, field, stars


@pytest.mark.parametrize("fwhm", [1.3, 2.0, 3.0, 5.0, 8.0])
def test_every_star_once_where_it_is_and_as_wide_as_it_is(fwhm):
    frame, xy, _ = field(RenderedStar(fwhm), faintest=3000.0 * max(1.0, fwhm / 2), apart=50)
    found = detect(frame)
    complete, pure, rms = compare(found, xy)
    assert complete == 1.0
    assert pure >= 0.97
    assert rms < 0.04 * fwhm
    assert np.median(found.fwhm_px) == pytest.approx(fwhm, rel=0.06)
    assert np.median(found.elongation[:20]) < (1.3 if fwhm < 2 else 1.05)


def test_flux_and_order():
    frame, xy, flux = field()
    found = detect(frame)
    assert (np.diff(found.flux) <= 0).all()
    nearest = np.hypot(*(found.xy[:, None] - xy).transpose(2, 0, 1)).argmin(axis=1)
    assert np.median(found.flux / flux[nearest]) == pytest.approx(1.0, abs=0.05)
    assert found.background == pytest.approx(500.0, abs=5.0)  # 400 electrons on a bias of 100
    assert found.noise == pytest.approx(np.sqrt(400 + 25), rel=0.1)
    # with this sky and image SNR is flux over noise times the root of the image's area
    assert np.median(found.snr / found.flux) == pytest.approx(1 / (20.6 * 4.59), rel=0.1)


@pytest.mark.parametrize(("length", "angle_deg"), [(6, 20), (12, 37), (20, -60), (20, 85)])
def test_trails_are_measured_not_split(length, angle_deg):
    angle = np.radians(angle_deg)
    image = RenderedStar(3.0, trail_px=(length * np.cos(angle), length * np.sin(angle)))
    frame, xy, _ = field(image, faintest=20_000, apart=50)
    found = detect(frame)
    complete, pure, _ = compare(found, xy, 3.0)
    assert complete >= 0.97
    assert pure >= 0.97
    turned = (found.angle_rad - angle + np.pi / 2) % np.pi - np.pi / 2
    assert np.abs(np.median(turned)) < np.radians(2)
    # second moments: sigma^2 along the trail gains length^2 / 12
    expected = np.sqrt(1 + (length**2 / 12) / (3.0 / 2.3548) ** 2)
    assert np.median(found.elongation) == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("outer", [4.0, 6.0, 10.0])
def test_rings_of_a_frame_out_of_focus_are_one_star_each(outer):
    frame, xy, _ = field(RenderedStar(2.5, ring_px=(outer / 2, outer)), faintest=60_000, apart=60)
    found = detect(frame)
    complete, pure, _ = compare(found, xy, 0.3 * outer)
    assert complete >= 0.95
    assert pure >= 0.95
    assert np.median(found.fwhm_px) > 1.4 * outer


@pytest.mark.parametrize("outer", [5.0, 6.6, 8.0])
def test_rings_are_measured_about_their_middle(outer):
    """A fit that began on the rim stayed there: stars were off by 0.5 to 1.7 px, many the same way."""
    frame, xy, _ = field(RenderedStar(2.5, ring_px=(outer / 2, outer)), faintest=60_000, apart=60)
    _, _, rms = compare(detect(frame), xy, outer)
    assert rms < 0.12


def test_hot_pixels_and_cosmic_rays_are_refused():
    sky = Sky(400.0, hot_per_mp=300.0, rays=60)
    frame, xy, _ = field(sky=sky, n=40)
    complete, pure, _ = compare(detect(frame), xy)
    assert complete >= 0.97
    assert pure >= 0.95
    empty = render(*SIZE, np.empty((0, 2)), np.empty(0), sky=Sky(400.0, hot_per_mp=300.0))
    assert len(detect(empty)) <= 3  # 92 hot pixels, and what noise makes


def test_a_star_beside_a_hot_pixel_is_found_where_it_is():
    frame, xy, _ = field(n=30)
    pixels = frame.pixels.copy()
    for x, y in np.rint(xy).astype(int):
        pixels[y + 3, x + 2] = 30_000
    complete, pure, rms = compare(detect(pixels), xy)
    assert complete >= 0.95
    assert pure >= 0.95
    assert rms < 0.15


@pytest.mark.parametrize("told", [True, False])
def test_a_saturated_star_is_one_detection(told):
    xy, flux = stars(n=20, apart=80)
    flux[:5] = 3e6
    frame = render(*SIZE, xy, flux, RenderedStar(4.0, beta=2.5), sensor=Sensor(saturation=5000.0))
    found = detect(frame if told else Frame(frame.pixels))
    complete, pure, _ = compare(found, xy, 1.0)
    assert complete == 1.0
    assert pure >= 0.95
    brightest = np.hypot(*(found.xy[:5, None] - xy[:5]).transpose(2, 0, 1)).min(axis=1)
    assert found.saturated[:5].all()
    assert brightest.max() < 0.5


@pytest.mark.parametrize("bayer", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_a_mosaic_is_seen_in_its_green(bayer):
    frame, xy, _ = field(RenderedStar(2.5), sensor=Sensor(bayer=bayer))
    complete, pure, rms = compare(detect(frame), xy)
    assert complete == 1.0
    assert pure >= 0.97
    assert rms < 0.08


def test_close_pairs_are_marked_and_lone_stars_are_not():
    lone, flux = stars(n=20, apart=60, faintest=20_000)
    xy = np.concatenate([lone, lone[:6] + np.array([5.0, 0.0])])
    found = detect(render(*SIZE, xy, np.concatenate([flux, flux[:6]]), RenderedStar(2.5)))
    assert len(found) == 26
    assert found.blended.sum() == 12


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.int32, np.uint32, np.float32, np.float64])
def test_the_type_of_the_pixels_does_not_matter(dtype):
    frame, _, _ = field(sky=Sky(100.0), faintest=1500.0, sensor=Sensor(gain_e=2.0, bias=10.0))
    pixels = np.minimum(frame.pixels, 250).astype(np.uint16)
    expected = detect(Frame(pixels, saturation=250.0))
    found = detect(Frame(pixels.astype(dtype), saturation=250.0))
    assert len(found) == len(expected) > 30
    np.testing.assert_allclose(found.xy, expected.xy, atol=2e-2)


@pytest.mark.parametrize(("width", "height"), [(639, 479), (640, 479), (639, 480), (257, 200)])
def test_odd_sizes(width, height):
    frame, xy, _ = field()
    inside = (xy < [width - 5, height - 5]).all(axis=1)
    found = detect(frame.pixels[:height, :width].copy())
    assert compare(found, xy[inside])[0] == 1.0
    assert (found.width, found.height) == (width, height)


def test_what_is_not_a_number_is_no_star():
    frame, xy, _ = field()
    pixels = frame.pixels.astype(np.float32)
    pixels[100:110] = np.nan
    pixels[:, 300:303] = np.inf
    pixels[200, 50:60] = -np.inf
    pixels[300, 400] = 3e38
    found = detect(pixels)
    clear = (np.abs(xy[:, 1] - 104.5) > 12) & (np.abs(xy[:, 0] - 301) > 9)
    clear &= (np.abs(xy - [55, 200]) > 12).any(axis=1)
    complete, _, rms = compare(found, xy[clear])
    assert complete >= 0.97
    assert rms < 0.1
    assert np.isfinite(found.flux).all()
    assert np.isfinite(found.xy).all()
    assert compare(found, xy)[1] >= 0.95


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (7, 7), (8, 8), (9, 300), (64, 64)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_tiny_frames_are_answered(shape, dtype):
    noise = np.random.default_rng(0).normal(100, 5, shape).astype(dtype)
    assert len(detect(noise)) <= 2


@pytest.mark.parametrize("level", [0, 128, 255])
def test_flat_frames_hold_nothing(level):
    assert len(detect(np.full((300, 400), level, dtype=np.uint8))) == 0


@pytest.mark.parametrize("kind", ["all nan", "all inf", "noise", "half"])
def test_frames_without_sense_hold_nothing(kind):
    pixels = np.random.default_rng(0).normal(0, 1, (200, 300)).astype(np.float32)
    if kind.startswith("all"):
        pixels[:] = float(kind.split()[1])
    if kind == "half":
        pixels[100:] = np.nan
    assert len(detect(pixels)) <= 1


def test_noise_alone_makes_less_than_one_star_a_frame():
    rng = np.random.default_rng(5)
    counts = [len(detect(rng.normal(1000, 30, (1000, 1000)).astype(np.uint16))) for _ in range(4)]
    assert sum(counts) <= 4


def test_scaling_the_pixels_scales_the_flux_alone():
    frame, _, _ = field()
    pixels = frame.pixels.astype(np.float64)
    one, other = detect(pixels), detect(pixels * 1e-4 - 3.0)
    np.testing.assert_allclose(other.xy, one.xy, atol=0.02)
    np.testing.assert_allclose(other.flux, one.flux * 1e-4, rtol=0.02)


def test_the_frame_is_left_as_it_was():
    frame, _, _ = field()
    before = frame.pixels.copy()
    frame.pixels.setflags(write=False)
    detect(frame)
    assert (frame.pixels == before).all()


def test_at_most_so_many_stars_and_the_brightest_of_them():
    frame, _, _ = field()
    every, few = detect(frame), DETECTORS.make("auto", max_stars=7).detect(frame)
    np.testing.assert_array_equal(few.xy, every.xy[:7])


def test_detectors_are_chosen_by_name():
    assert all(hasattr(DETECTORS.make(name), "detect") for name in DETECTORS)
    with pytest.raises(UsageError, match="no detector 'x'; choose one of auto, clusters"):
        DETECTORS.make("x")


def test_four_stars_of_unlike_sizes_are_no_crash():
    """The usual size was taken between the second and the third, where no star is."""
    frames = [
        render(400, 400, np.array([place]), np.array([9e4]), RenderedStar(fwhm), seed=3)
        for place, fwhm in (((80.0, 90.0), 2.4), ((300.0, 80.0), 2.6), ((90.0, 310.0), 8.4), ((310.0, 300.0), 9.0))
    ]
    pixels = np.max([frame.pixels for frame in frames], axis=0)
    assert len(detect(Frame(pixels))) == 4
