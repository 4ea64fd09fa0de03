"""What the solve doctor measures, on frames whose light, trails and widths are known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.frame import Detections, Frame, Hint
from kochab.core.solution import NoSolution, Reason
from kochab.solver.diagnosis import Evidence, diagnose, implied_field_deg
from kochab.solver.frame_quality import (
    Bins,
    Discs,
    binned,
    clipping_level,
    half_flux_diameter_px,
    measure_discs,
    measure_light,
    measure_trails,
)

W, H = 800, 600
RNG_SEED = 8


def stars(count: int = 30, **shapes: object) -> Detections:
    """Detections without a frame, all of one shape."""
    xy = np.random.default_rng(RNG_SEED).uniform((0, 0), (W - 1, H - 1), (count, 2))
    plain = Detections.from_list(xy, W, H)
    return replace(plain, **{name: np.broadcast_to(value, count).copy() for name, value in shapes.items()})


def doctor(found: Detections, hint: Hint | None = None, frame: Frame | None = None) -> NoSolution:
    return diagnose(Evidence(found, hint, frame), None, {})


# -- From the shapes of the detections ----------------------------------------------------------


@pytest.mark.parametrize("angle_deg", [20.0, 160.0])
def test_long_stars_that_agree_on_a_direction_are_trails(angle_deg: float) -> None:
    """A star's width is the mean of its axes: here 12 and 4 px, whose squares differ by the trail's.

    The trail itself is an even bar, longer than a Gaussian as wide is at half its maximum.
    """
    found = doctor(stars(fwhm_px=np.sqrt(4.0 * 12.0), elongation=3.0, angle_rad=np.radians(angle_deg)))
    assert found.reason is Reason.TRAILED
    assert found.measured["trail_px"] == pytest.approx(np.sqrt(12.0**2 - 4.0**2) * np.sqrt(12.0) / 2.3548)
    assert found.measured["trail_angle_deg"] == pytest.approx(angle_deg)
    assert f"trail 17 px at {angle_deg:.0f} deg" in found.advice


def test_trails_need_length_a_direction_and_stars() -> None:
    """Coma points everywhere, seeing is never quite round, and three stars may be anything."""
    long = stars(fwhm_px=4.0, elongation=3.0, angle_rad=0.5)
    everywhere = replace(long, angle_rad=np.linspace(0.0, np.pi, 30, endpoint=False))
    half_round = stars(fwhm_px=4.0, elongation=1.7, angle_rad=0.5)
    assert doctor(long).reason is Reason.TRAILED
    assert doctor(everywhere).reason is Reason.NO_PATTERN_AGREED
    assert doctor(half_round).reason is Reason.NO_PATTERN_AGREED
    assert doctor(long.take(slice(0, 3))).reason is Reason.TOO_FEW_STARS
    unknown = replace(long, angle_rad=np.where(np.arange(30) < 10, 0.5, np.nan))
    assert doctor(unknown).measured["trail_angle_deg"] == pytest.approx(np.degrees(0.5))


def test_trails_are_all_over_the_frame_and_as_long_as_one_another() -> None:
    """Lines of letters stand in a part of it, streaks of satellites are of any length."""
    long = stars(fwhm_px=4.0, elongation=3.0, angle_rad=0.5)
    assert doctor(long).reason is Reason.TRAILED
    below = replace(long, xy=long.xy * (1.0, 0.25) + (0.0, 0.75 * H))
    assert doctor(below).reason is Reason.NO_PATTERN_AGREED
    assert doctor(replace(long, fwhm_px=np.geomspace(1.0, 1000.0, 30))).reason is not Reason.TRAILED


@pytest.mark.parametrize(("exposure_s", "cure"), [(None, "wait 5 s"), (20.0, "wait 5 s"), (30.0, "shorter than 30 s")])
def test_only_a_long_exposure_trails_because_nothing_tracks(exposure_s: float | None, cure: str) -> None:
    found = doctor(stars(fwhm_px=4.0, elongation=3.0, angle_rad=0.5), Hint(exposure_s=exposure_s))
    assert cure in found.advice


def test_focus_is_asked_for_from_twelve_pixels_on_and_from_three_stars() -> None:
    assert doctor(stars(fwhm_px=11.5)).reason is Reason.NO_PATTERN_AGREED
    assert doctor(stars(fwhm_px=12.5)).reason is Reason.OUT_OF_FOCUS
    assert doctor(stars(3, fwhm_px=12.5)).reason is Reason.OUT_OF_FOCUS
    assert doctor(stars(2, fwhm_px=12.5)).reason is Reason.TOO_FEW_STARS
    assert "20 px wide" in doctor(stars(fwhm_px=20.0)).advice


def test_saturated_stars_are_counted() -> None:
    found = doctor(stars(saturated=np.arange(30) < 7))
    assert found.measured["saturated_stars"] == 7.0
    assert found.measured["stars_found"] == 30.0


# -- From the hinted scale ----------------------------------------------------------------------


@pytest.mark.parametrize("width_deg", [0.5, 40.0, 120.0])
def test_the_implied_field_is_that_of_a_tangent_plane(width_deg: float) -> None:
    scale = np.degrees(2.0 * np.tan(np.radians(width_deg / 2.0)) / W) * 3600.0
    hint = Hint(scale_arcsec_px=(0.8 * scale, scale / 0.8))
    assert implied_field_deg(Evidence(stars(), hint)) == pytest.approx(width_deg, rel=1e-9)


def test_a_fisheye_is_blamed_beyond_a_hundred_degrees_and_only_when_it_shows_stars() -> None:
    scale = {deg: np.degrees(2.0 * np.tan(np.radians(deg / 2.0)) / W) * 3600.0 for deg in (98.0, 102.0)}
    within, beyond = (Hint(scale_arcsec_px=(s, s)) for s in scale.values())
    assert doctor(stars(20), beyond).reason is Reason.DISTORTION_TOO_STRONG
    assert doctor(stars(20), within).reason is Reason.NO_PATTERN_AGREED
    assert doctor(stars(19), beyond).reason is Reason.NO_PATTERN_AGREED


@pytest.mark.parametrize(("expected", "small"), [(9.5, True), (10.5, False)])
def test_a_field_in_which_the_catalogue_has_fewer_than_ten_stars_is_too_small(expected: float, small: bool) -> None:
    from kochab.sky import open_catalogue

    width_deg = np.sqrt(expected / 0.75 * 41253.0 / len(open_catalogue()))
    scale = np.degrees(2.0 * np.tan(np.radians(width_deg / 2.0)) / W) * 3600.0
    found = doctor(stars(), Hint(scale_arcsec_px=(scale, scale)))
    assert found.measured["stars_expected"] == pytest.approx(expected)
    assert (found.reason is Reason.FIELD_TOO_SMALL) is small
    if small:
        assert f"{width_deg:.2f} deg wide" in found.advice


def test_the_stars_expected_grow_with_the_field_and_stop_at_the_whole_sky() -> None:
    """Without a place the mean over the sky: 41253 square degrees hold the whole catalogue."""
    from kochab.sky import open_catalogue

    def expected(width_deg: float) -> float:
        scale = np.degrees(2.0 * np.tan(np.radians(width_deg / 2.0)) / W) * 3600.0
        return doctor(stars(), Hint(scale_arcsec_px=(scale, scale))).measured["stars_expected"]

    whole = len(open_catalogue())
    assert expected(10.0) == pytest.approx(whole * 10.0 * 7.5 / 41253.0)
    assert expected(179.0) == pytest.approx(whole * 179.0**2 * 0.75 / 41253.0)


# -- From the light ----------------------------------------------------------------------------


def noisy(level: float, sigma: float = 10.0) -> np.ndarray:
    return np.random.default_rng(RNG_SEED).normal(level, sigma, (H, W))


def test_levels_are_shares_of_the_clipping_level() -> None:
    pixels = noisy(10000.0)
    pixels[:, :80] = 50000.0
    frame = Frame(pixels.astype(np.uint16), saturation=40000.0)
    light = measure_light(frame, binned(frame))
    assert light.background_share == pytest.approx(0.25, abs=0.001)
    assert light.saturated_share == pytest.approx(0.1, abs=0.002)
    assert light.glare_share == pytest.approx(0.1)
    assert light.glare_aspect == pytest.approx(600 / 80, rel=1e-3)


def test_the_contrast_is_how_many_sigmas_the_brightest_thousandth_stands_out() -> None:
    pixels = noisy(1000.0)
    pixels.ravel()[:: H * W // 1000] = 1500.0
    frame = Frame(pixels.astype(np.float32), saturation=65535.0)
    assert measure_light(frame, binned(frame)).contrast == pytest.approx(50.0, rel=0.05)
    plain = Frame(noisy(1000.0).astype(np.float32), saturation=65535.0)
    assert measure_light(plain, binned(plain)).contrast == pytest.approx(3.1, abs=0.1)


@pytest.mark.parametrize(
    ("pixels", "share"),
    [(np.full((H, W), 0.25, np.float32), 1.0), (np.full((H, W), 51, np.uint8), 0.2), (np.zeros((H, W), np.int16), 0.0)],
)
def test_without_a_saturation_the_clipping_level_is_that_of_the_pixels(pixels: np.ndarray, share: float) -> None:
    frame = Frame(pixels)
    assert measure_light(frame, binned(frame)).background_share == pytest.approx(share)


@pytest.mark.parametrize(("level", "day"), [(0.44, False), (0.47, True)])
def test_a_background_of_half_scale_is_daylight(level: float, day: bool) -> None:
    frame = Frame(noisy(level * 65535.0).astype(np.uint16), saturation=65535.0)
    found = doctor(stars(snr=20.0), None, frame)
    assert (found.reason is Reason.CLOUDED_OR_DARK) is day


def test_stars_that_may_be_noise_do_not_make_a_flat_frame_a_sky() -> None:
    flat = Frame(noisy(500.0).astype(np.uint16), saturation=65535.0)
    faint = stars(snr=np.where(np.arange(30) < 2, 20.0, 7.0))
    assert doctor(faint, None, flat).reason is Reason.CLOUDED_OR_DARK
    clear = replace(faint, snr=np.where(np.arange(30) < 3, 20.0, 7.0))
    assert doctor(clear, None, flat).reason is Reason.TOO_FEW_STARS


@pytest.mark.parametrize(
    ("width", "height", "count", "moon"),
    [(40, 40, 19, True), (40, 40, 20, False), (25, 25, 19, False), (160, 20, 19, False), (500, 500, 19, False)],
)
def test_the_moon_is_a_round_patch_neither_tiny_nor_half_the_frame_and_hides_stars(
    width: int, height: int, count: int, moon: bool
) -> None:
    pixels = noisy(500.0)
    pixels[50 : 50 + height, 60 : 60 + width] = 65535.0
    frame = Frame(pixels.clip(0, 65535).astype(np.uint16), saturation=65535.0)
    found = doctor(stars(count, snr=20.0), None, frame)
    assert ("Moon" in found.advice) is moon
    if moon:
        assert found.measured["glare_share"] == pytest.approx(width * height / (W * H))


# -- Trails and widths on the pixels ------------------------------------------------------------


def bars(length: int, width: int, count: int = 12, upright: bool = False) -> np.ndarray:
    """Bright bars on noise, on a grid."""
    pixels = noisy(200.0)
    for k in range(count):
        y, x = 60 + 140 * (k // 4), 60 + 180 * (k % 4)
        pixels[np.s_[y : y + length, x : x + width] if upright else np.s_[y : y + width, x : x + length]] = 5000.0
    return pixels


@pytest.mark.parametrize(("upright", "angle_deg"), [(False, 0.0), (True, 90.0)])
def test_bars_have_their_own_length_shape_and_direction(upright: bool, angle_deg: float) -> None:
    """The variance of a bar is a twelfth of its length squared, in bins of two pixels too."""
    for step in (1, 2):
        trails = measure_trails(Bins(bars(40, 5, upright=upright), step))
        assert trails.length_px == pytest.approx(40.0 * step, rel=0.01)
        assert trails.aspect == pytest.approx(8.0, rel=0.01)
        assert trails.angle_deg % 180.0 == pytest.approx(angle_deg, abs=1e-6)
        assert trails.count == 12


def test_specks_and_vast_patches_are_no_trails() -> None:
    pixels = bars(40, 5, 6)
    pixels[300, 300:305] = 5000.0  # five bins: too few for a shape
    pixels[400:520, 300:620] = 5000.0  # 8 % of the frame
    assert measure_trails(Bins(pixels, 1)).count == 6
    assert measure_trails(Bins(np.zeros((H, W)), 1)).count == 0
    only_specks = noisy(200.0, 1.0)
    only_specks[300, 300:305] = 5000.0
    assert measure_trails(Bins(only_specks, 1)).count == 0


@pytest.mark.parametrize("radius", [3.0, 8.0])
def test_the_half_flux_diameter_of_a_disc_is_two_thirds_of_its_own(radius: float) -> None:
    y, x = np.mgrid[:H, :W]
    pixels = np.full((H, W), 100.0)
    places = np.array([[200.3, 150.6], [500.0, 300.0], [401.4, 449.8]])
    for cx, cy in places:
        pixels[np.hypot(x - cx, y - cy) <= radius] = 3000.0
    found = replace(Detections.from_list(places, W, H), fwhm_px=np.full(3, 2.0 * radius))
    assert half_flux_diameter_px(Frame(pixels), found) == pytest.approx(4.0 / 3.0 * radius, rel=0.04)


def test_saturated_blended_and_cut_stars_say_nothing_of_the_focus() -> None:
    y, x = np.mgrid[:H, :W]
    pixels = np.where(np.hypot(x - 200, y - 150) <= 3.0, 3000.0, 100.0)
    found = replace(Detections.from_list(np.array([[200.0, 150.0]]), W, H), fwhm_px=np.array([6.0]))
    frame = Frame(pixels)
    yes = np.array([True])
    assert half_flux_diameter_px(frame, found) == pytest.approx(4.0, rel=0.1)
    for out in (
        replace(found, saturated=yes),
        replace(found, blended=yes),
        replace(found, xy=np.array([[5.0, 150.0]])),
    ):
        assert np.isnan(half_flux_diameter_px(frame, out))


def test_pixels_that_are_not_finite_are_dark_bins() -> None:
    pixels = np.full((60, 80), 7.0, np.float32)
    pixels[3, 4], pixels[5, 6], pixels[7, 8] = np.inf, -np.inf, np.nan
    bins = binned(Frame(pixels))
    assert (bins.image[3, 4], bins.image[5, 6], bins.image[7, 8]) == (0.0, 0.0, 0.0)
    assert np.count_nonzero(bins.image == 7.0) == 60 * 80 - 3


def test_a_pixel_at_the_clipping_level_is_saturated() -> None:
    pixels = np.full((H, W), 1000, np.uint16)
    pixels[:, :400] = 40000
    frame = Frame(pixels, saturation=40000.0)
    assert measure_light(frame, binned(frame)).saturated_share == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("width_deg", "near"), [(5.7, True), (5.8, False)])
def test_at_a_known_place_the_catalogue_is_counted_in_a_circle_as_large_as_the_frame(width_deg, near) -> None:
    """Of a frame three quarters as high as wide; beyond 25 square degrees the mean over the sky will do."""
    from kochab.core.attitude import unit_vectors
    from kochab.sky import open_catalogue

    catalogue = open_catalogue()
    scale = np.degrees(2.0 * np.tan(np.radians(width_deg / 2.0)) / W) * 3600.0
    hint = Hint(scale_arcsec_px=(scale, scale), centre_deg=(300.0, 35.0, 1.0))
    area = 0.75 * width_deg**2
    assert (area < 25.0) is near
    everything = catalogue.vectors(np.arange(len(catalogue)), 2000.0)
    away = np.linalg.norm(everything - unit_vectors(300.0, 35.0), axis=1)
    counted = np.sum(away < 2.0 * np.sin(np.radians(np.sqrt(area / np.pi)) / 2.0))
    expected = doctor(stars(), hint).measured["stars_expected"]
    assert expected == pytest.approx(counted if near else len(catalogue) * area / 41253.0, rel=5e-3)
    assert counted > 1.5 * len(catalogue) * area / 41253.0


@pytest.mark.parametrize("side", [np.s_[12], np.s_[28], np.s_[:, 32], np.s_[:, 48]])
def test_the_light_of_a_star_is_what_stands_two_sigmas_above_its_stamps_rim(side) -> None:
    """A rim that a neighbour crosses, on any side, hides the faint light: here its outer ring."""
    y, x = np.mgrid[:60, :80]
    radius = np.hypot(x - 40.0, y - 20.0)
    pixels = np.full((60, 80), 100.0)
    pixels[radius <= 4.0] = 700.0
    pixels[radius <= 2.0] = 3000.0
    pixels[side] += 1000.0  # a trail along the rim, eight pixels from the star
    reach = 8
    stamp = pixels[20 - reach : 21 + reach, 40 - reach : 41 + reach]
    rim = np.concatenate([stamp[0], stamp[-1], stamp[:, 0], stamp[:, -1]])
    light = np.maximum(stamp - np.median(rim) - 2.0 * np.std(rim), 0.0)
    expected = 2.0 * np.sum(light * radius[12:29, 32:49]) / np.sum(light)
    found = replace(Detections.from_list(np.array([[40.0, 20.0]]), 80, 60), fwhm_px=np.array([3.2]))
    assert half_flux_diameter_px(Frame(pixels), found) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("fwhm_px", "reach"), [(np.nan, 4), (1.0, 4), (4.0, 10), (20.0, 30)])
def test_a_stamp_reaches_two_and_a_half_widths_and_lies_whole_in_the_frame(fwhm_px, reach) -> None:
    """From 4 to 30 px; a star nearer to the border says nothing."""
    pixels = np.full((90, 90), 100.0)
    for at, inside in ((reach, True), (reach - 1, False), (89 - reach, True), (90 - reach, False)):
        for place in ((at, 45), (45, at)):
            lit = pixels.copy()
            lit[place[1], place[0]] = 5000.0
            found = replace(Detections.from_list(np.array([place], float), 90, 90), fwhm_px=np.array([fwhm_px]))
            assert bool(np.isfinite(half_flux_diameter_px(Frame(lit), found))) is inside


def test_the_fifteen_brightest_stars_that_are_whole_tell_the_focus() -> None:
    y, x = np.mgrid[:H, :W]
    places = np.array([(60.0 + 100.0 * (k % 7), 60.0 + 100.0 * (k // 7)) for k in range(28)])
    pixels = np.full((H, W), 100.0)
    for k, (cx, cy) in enumerate(places):  # the eight that count least are small, then large ones
        pixels[np.hypot(x - cx, y - cy) <= (2.0 if k < 8 else 6.0)] = 3000.0
    found = replace(Detections.from_list(places, W, H), fwhm_px=np.full(28, 8.0))
    small = half_flux_diameter_px(Frame(pixels), found)
    assert small == pytest.approx(4.0 / 3.0 * 2.0, rel=0.15)  # eight of fifteen
    one_less = replace(found, blended=np.arange(28) == 0)
    assert half_flux_diameter_px(Frame(pixels), one_less) == pytest.approx(4.0 / 3.0 * 6.0, rel=0.05)


@pytest.mark.parametrize(("sigmas", "count"), [(3.5, 12), (8.0, 24)])
def test_patches_stand_five_sigmas_out_where_bright_ones_are_many(sigmas: float, count: int) -> None:
    """Bars over more than a hundredth of the frame; what is only three and a half sigmas bright is no patch."""
    pixels = noisy(200.0, 10.0)
    for k in range(12):
        y, x = 60 + 140 * (k // 4), 60 + 180 * (k % 4)
        pixels[y : y + 9, x : x + 90] = 5000.0
        pixels[y + 60 : y + 64, x : x + 40] = 200.0 + 10.0 * sigmas
    trails = measure_trails(Bins(pixels, 1))
    assert trails.count == count
    assert trails.aspect == pytest.approx(10.0, rel=0.05)


def test_the_sixty_largest_patches_tell_the_trails() -> None:
    pixels = noisy(200.0, 1.0)
    for k in range(60):
        y, x = 20 + 55 * (k // 6), 20 + 130 * (k % 6)
        pixels[y : y + 4, x : x + 40] = 5000.0
        pixels[y + 20 : y + 28, x + 60 : x + 62] = 5000.0  # smaller ones, across
    trails = measure_trails(Bins(pixels, 1))
    assert trails.count == 60
    assert trails.length_px == pytest.approx(40.0, rel=0.02)
    assert min(trails.angle_deg, 180.0 - trails.angle_deg) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("shape", "bayer", "step"),
    [
        ((60, 80), None, 1),
        ((60, 80), "RGGB", 2),
        ((1000, 1700), None, 1),
        ((1000, 1900), None, 2),
        ((3400, 900), None, 3),
        ((3400, 900), "RGGB", 4),
        ((4900, 900), "RGGB", 4),
        ((1, 1), "RGGB", 1),
        ((3, 4000), None, 3),
    ],
)
def test_bins_are_as_large_as_leaves_twelve_hundred_a_side_and_colour_cells_whole(shape, bayer, step) -> None:
    bins = binned(Frame(np.zeros(shape, np.uint8), bayer=bayer))
    assert bins.step == step
    assert bins.image.shape == (shape[0] // step, shape[1] // step)


def test_a_search_that_ran_out_of_time_stays_one_whatever_the_frame_shows() -> None:
    trailed = Evidence(stars(fwhm_px=4.0, elongation=3.0, angle_rad=0.5))
    assert diagnose(trailed, None, {}).reason is Reason.TRAILED
    ended = diagnose(trailed, NoSolution(Reason.TIMED_OUT, "Allow more than 3 s."), {})
    assert (ended.reason, ended.advice) == (Reason.TIMED_OUT, "Allow more than 3 s.")
    assert ended.measured["trail_px"] > 9.0


def test_narrow_bars_have_the_variance_of_whole_pixels() -> None:
    """A twelfth of the side's square, of three pixels too; a single row is one pixel wide."""
    for width, rel in ((3, 2e-3), (1, 2e-3)):
        trails = measure_trails(Bins(bars(40, width), 1))
        assert trails.aspect == pytest.approx(40.0 / width, rel=rel)
        assert trails.length_px == pytest.approx(40.0, rel=1e-3)


def test_a_frame_of_floats_that_is_all_black_has_no_light() -> None:
    black = Frame(np.zeros((60, 80)))
    light = measure_light(black, binned(black))
    assert (light.background_share, light.contrast, light.glare_share, light.glare_aspect) == (0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_the_focus_is_the_same_in_any_unit_of_light(scale: float) -> None:
    y, x = np.mgrid[:H, :W]
    pixels = np.where(np.hypot(x - 200, y - 150) <= 3.0, 3000.0, 100.0) * scale
    found = replace(Detections.from_list(np.array([[200.0, 150.0]]), W, H), fwhm_px=np.array([6.0]))
    assert half_flux_diameter_px(Frame(pixels), found) == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(("width", "count"), [(2, 12), (1, 0)])
def test_six_bins_are_enough_for_a_shape(width: int, count: int) -> None:
    """Three by two of them; five in a row are not."""
    pixels = bars(3 if width == 2 else 5, width)
    assert measure_trails(Bins(pixels, 1)).count == count


@pytest.mark.parametrize(
    ("shape", "side"), [((40, 60), 31), ((380, 900), 31), ((400, 384), 32), ((600, 800), 50), ((1200, 1200), 100)]
)
def test_the_background_of_shapes_is_a_twelfth_of_the_frame_wide_or_thirty_one_bins(monkeypatch, shape, side) -> None:
    from scipy import ndimage

    sides, smooth = [], ndimage.uniform_filter
    monkeypatch.setattr(ndimage, "uniform_filter", lambda image, size: sides.append(size) or smooth(image, size))
    measure_trails(Bins(np.zeros(shape), 1))
    assert sides == [side]


@pytest.mark.parametrize(("across", "agreed"), [(3, True), (4, False)])
def test_trails_have_a_direction_when_three_fifths_agree(across: int, agreed: bool) -> None:
    """Of sixteen, three across leave 10/16 of the sum, four half of it."""
    pixels = noisy(200.0, 1.0)
    for k in range(16):
        y, x = 40 + 140 * (k // 4), 40 + 190 * (k % 4)
        pixels[np.s_[y : y + 40, x : x + 5] if k < across else np.s_[y : y + 5, x : x + 40]] = 5000.0
    trails = measure_trails(Bins(pixels, 1))
    assert trails.count == 16
    assert bool(np.isfinite(trails.angle_deg)) is agreed


@pytest.mark.parametrize(("level", "share"), [(0.49, 0.0), (0.51, 1600 / 480000)])
def test_glare_is_brighter_than_half_the_clipping_level(level: float, share: float) -> None:
    pixels = noisy(100.0, 1.0)
    pixels[200:240, 300:340] = level * 40000.0
    frame = Frame(pixels.astype(np.float32), saturation=40000.0)
    assert measure_light(frame, binned(frame)).glare_share == pytest.approx(share)


# -- Discs ---------------------------------------------------------------------------------------


def discs(diameter_px: float, level: float, hole: float = 0.0, count: int = 12, spread_mag: float = 0.0) -> Frame:
    """Discs, sharp but for the seeing, on a sky that falls off to one side, from the brightest to the faintest."""
    from scipy.ndimage import gaussian_filter

    y, x = np.mgrid[:H, :W]
    pixels = np.zeros((H, W))
    for k in range(count):
        away = np.hypot(x - 110.3 - 180.0 * (k % 4), y - 100.6 - 190.0 * (k // 4)) * 2.0 / diameter_px
        pixels[(away < 1.0) & (away >= hole)] = level * 10.0 ** (-0.4 * spread_mag * k / max(count - 1, 1))
    return Frame((gaussian_filter(pixels, 1.3) + noisy(500.0) + 0.3 * x).astype(np.uint16), saturation=65535.0)


def all_discs(frame: Frame) -> Discs:
    return measure_discs(binned(frame), clipping_level(frame))


@pytest.mark.parametrize(("diameter_px", "hole"), [(14.0, 0.4), (25.0, 0.0), (40.0, 0.4), (60.0, 0.0)])
def test_discs_and_rings_have_their_own_diameter(diameter_px: float, hole: float) -> None:
    found = all_discs(discs(diameter_px, 60.0, hole))
    assert found.count >= 7
    assert found.diameter_px == pytest.approx(diameter_px, rel=0.1)


def test_seeing_saturation_and_trails_make_no_discs() -> None:
    """A Gaussian has no edge, a saturated star says how bright it is, a bar is not round."""
    from scipy.ndimage import gaussian_filter

    points = np.zeros((H, W))
    points[60::100, 60::100] = 1.0
    soft = Frame((gaussian_filter(points, 8.0) * 500.0 * 402.0 + noisy(500.0)).astype(np.uint16), saturation=65535.0)
    full = discs(25.0, 60000.0)
    clipped = Frame(np.minimum(full.pixels, 50000), saturation=50000.0)
    assert all_discs(full).count >= 9
    for frame in (soft, clipped, Frame(bars(40, 5).astype(np.uint16), saturation=65535.0), Frame(noisy(500.0))):
        assert all_discs(frame).count <= 1


def test_stars_of_two_sizes_are_not_out_of_focus_together() -> None:
    both = discs(20.0, 60.0, count=12).pixels.astype(int)
    both[:, W // 2 :] = discs(40.0, 60.0, count=12).pixels[:, W // 2 :]
    assert 5 <= all_discs(Frame(both.astype(np.uint16), saturation=65535.0)).count <= 7


@pytest.mark.parametrize(("clear", "count", "blurred"), [(20, 3, True), (30, 3, False), (6, 2, False), (2, 2, True)])
def test_discs_among_many_sharp_stars_are_something_else(clear: int, count: int, blurred: bool) -> None:
    """Nebulae, ghosts and lamps: at least one in eight clear stars, and three where there are so many."""
    frame = discs(40.0, 300.0, count=count, spread_mag=2.0)
    found = doctor(stars(clear, snr=20.0, blended=True), None, frame)
    assert all_discs(frame).count == count
    assert (found.reason is Reason.OUT_OF_FOCUS) is blurred
    assert ("disc_diameter_px" in found.measured) is blurred


def test_discs_are_told_before_the_glare_and_where_the_detector_finds_nothing() -> None:
    frame = discs(40.0, 300.0, spread_mag=2.0)
    pixels = frame.pixels.copy()
    pixels[20:70, 550:600] = 65535
    lit = Frame(pixels, saturation=65535.0)
    assert doctor(stars(9, snr=20.0, blended=True), None, lit).reason is Reason.OUT_OF_FOCUS
    assert "40 px wide" in doctor(stars(0), None, frame).advice


@pytest.mark.parametrize(("level", "spread_mag", "dust"), [(60.0, 0.5, True), (60.0, 2.0, False), (600.0, 0.5, False)])
def test_faint_discs_all_as_bright_are_dust_on_a_flat_of_another_night(level, spread_mag, dust) -> None:
    """Stars' discs differ by magnitudes, or stand far above the sky."""
    frame = discs(40.0, level, spread_mag=spread_mag)
    found = all_discs(frame)
    assert found.count >= 8
    assert found.dust is dust
    assert found.share == pytest.approx(level / np.median(frame.pixels), rel=0.1)
    sky = doctor(stars(6, snr=20.0, blended=True, fwhm_px=25.0), None, frame)
    assert (sky.reason is Reason.OUT_OF_FOCUS) is not dust


@pytest.mark.parametrize(("level", "dust"), [(60.0, True), (600.0, False)])
def test_faint_discs_of_several_widths_are_dust_however_unlike_in_brightness(level, dust) -> None:
    """Specks lie at several distances from the sensor; stars out of focus are all as wide."""
    both = discs(20.0, level, spread_mag=2.0).pixels.astype(int)
    both[:, W // 2 :] = discs(40.0, level, spread_mag=2.0).pixels[:, W // 2 :]
    found = all_discs(Frame(both.astype(np.uint16), saturation=65535.0))
    assert found.spread > 0.35
    assert found.others >= 3
    assert found.dust is dust


@pytest.mark.parametrize("count", [2, 3])
def test_two_discs_do_not_tell_dust_from_stars(count) -> None:
    assert all_discs(discs(40.0, 60.0, count=count)).dust is (count == 3)


def test_sharp_stars_are_in_focus_whatever_discs_are_there() -> None:
    frame, found = discs(40.0, 60.0), stars(12, snr=20.0, fwhm_px=2.5)
    pixels = frame.pixels.copy()
    for x, y in found.xy.round().astype(int):
        pixels[y - 1 : y + 2, x - 1 : x + 2] = 5000
    sharp = Frame(pixels, saturation=65535.0)
    assert all_discs(sharp).count >= 8
    assert doctor(found, None, sharp).reason is Reason.NO_PATTERN_AGREED


# -- Noise among the stars ------------------------------------------------------------------------


def test_only_clear_stars_count_as_stars() -> None:
    """Four stars beside nine bumps of the noise were "no pattern agreed"."""
    few = doctor(stars(13, snr=np.where(np.arange(13) < 4, 400.0, 6.0)))
    assert few.reason is Reason.TOO_FEW_STARS
    assert "Only 4 stars stand out from the noise" in few.advice
    assert "Only 1 star found, " in doctor(stars(1, snr=400.0)).advice
    assert doctor(stars(13, snr=np.where(np.arange(13) < 6, 400.0, 6.0))).reason is Reason.NO_PATTERN_AGREED


def test_trails_of_the_clear_stars_are_seen_through_noise() -> None:
    rng = np.random.default_rng(RNG_SEED)
    clear = np.arange(40) < 12
    mixed = stars(
        40,
        fwhm_px=4.0,
        elongation=np.where(clear, 3.0, 1.6),
        angle_rad=np.where(clear, 0.5, rng.uniform(0.0, np.pi, 40)),
        snr=np.where(clear, 50.0, 6.0),
    )
    assert doctor(mixed).measured["trail_angle_deg"] == pytest.approx(np.degrees(0.5))
    assert doctor(replace(mixed, snr=np.full(40, 50.0))).reason is Reason.NO_PATTERN_AGREED


@pytest.mark.parametrize(("count", "spread_rad", "trailed"), [(5, 0.02, True), (6, 0.5, False), (30, 0.5, True)])
def test_few_stars_must_agree_the_better_on_a_direction(count: int, spread_rad: float, trailed: bool) -> None:
    angles = 0.5 + spread_rad * np.linspace(-1.0, 1.0, count)
    found = doctor(stars(count, fwhm_px=4.0, elongation=3.0, angle_rad=angles))
    assert (found.reason is Reason.TRAILED) is trailed
