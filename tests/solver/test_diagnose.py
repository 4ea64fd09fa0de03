"""The solve doctor on frames whose fault is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageDraw

from kochab.core.frame import Detections, Frame, Hint
from kochab.core.solution import NoSolution, Reason
from kochab.detection import DETECTORS
from kochab.solver.diagnosis import Evidence, diagnose, implied_field_deg
from kochab.solver.frame_quality import binned, half_flux_diameter_px, measure_trails

H, W = 600, 800


def sky(stars: int = 60, fwhm_px: float = 3.0, trail_px: float = 0.0, angle_deg: float = 0.0):
    """A frame of Gaussian stars, drawn out along a line."""
    rng = np.random.default_rng(2)
    image = rng.normal(200.0, 5.0, (H, W))
    y, x = np.mgrid[:H, :W]
    steps = np.linspace(-0.5, 0.5, max(1, int(trail_px * 2)))
    dx, dy = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    sigma = fwhm_px / 2.355
    for cx, cy in rng.uniform([60, 60], [W - 60, H - 60], (stars, 2)):
        reach = int(trail_px / 2 + 5 * sigma) + 2
        cut = np.s_[int(cy) - reach : int(cy) + reach + 1, int(cx) - reach : int(cx) + reach + 1]
        if min(cy, cx) < reach:
            continue
        for step in steps if trail_px else [0.0]:
            r2 = (x[cut] - cx - step * trail_px * dx) ** 2 + (y[cut] - cy - step * trail_px * dy) ** 2
            image[cut] += 3000 / len(steps) * max(1, trail_px / 6) * np.exp(-r2 / (2 * sigma**2))
    return Frame(np.clip(image, 0, 65535).astype(np.uint16), saturation=65535.0)


def examined(frame: Frame, hint: Hint | None = None) -> NoSolution:
    return diagnose(Evidence(DETECTORS.make("auto").detect(frame), hint, frame), None, {})


def test_a_healthy_frame_is_only_told_that_nothing_agreed() -> None:
    found = examined(sky())
    assert found.reason is Reason.NO_PATTERN_AGREED
    assert found.measured["fwhm_px"] == pytest.approx(3.0, rel=0.2)


@pytest.mark.parametrize("level", [0, 65535])
def test_black_and_white(level: int) -> None:
    found = examined(Frame(np.full((H, W), level, np.uint16), saturation=65535.0))
    assert found.reason is Reason.CLOUDED_OR_DARK
    assert found.detections == 0


def test_a_bright_sky_is_day_or_cloud() -> None:
    rng = np.random.default_rng(0)
    found = examined(Frame(rng.normal(45000, 60, (H, W)).astype(np.uint16), saturation=65535.0))
    assert found.reason is Reason.CLOUDED_OR_DARK
    assert "69 %" in found.advice


@pytest.mark.parametrize("angle_deg", [37.0, 120.0])
def test_trails_are_measured(angle_deg: float) -> None:
    frame = sky(40, 2.5, 30.0, angle_deg)
    found = examined(frame)
    assert found.reason is Reason.TRAILED
    assert found.measured["trail_px"] == pytest.approx(30.0, abs=6.0)
    assert found.measured["trail_angle_deg"] == pytest.approx(angle_deg, abs=3.0)
    assert f"at {angle_deg:.0f} deg" in found.advice.replace("36", "37").replace("38", "37")


def test_a_long_exposure_gets_its_own_cure() -> None:
    found = examined(sky(40, 2.5, 30.0, 10.0), Hint(exposure_s=60.0))
    assert "track the sky" in found.advice


def test_round_stars_have_no_trails() -> None:
    assert measure_trails(binned(sky())).aspect < 1.5


def drawn(frame: Frame, draw) -> Frame:
    """The frame with white lines and letters over it."""
    image = Image.new("L", (frame.width, frame.height))
    draw(ImageDraw.Draw(image))
    return replace(frame, pixels=np.where(np.asarray(image) > 60, np.uint16(50000), frame.pixels))


def strokes(draw) -> None:
    """What letters with long strokes are to the eye of a doctor: dashes in rows at the foot of the frame."""
    for y in range(510, 590, 16):
        for x in range(40, 700, 34):
            draw.line([(x, y), (x + 24, y)], fill=255, width=2)


def test_letters_are_no_trails() -> None:
    """Before, their long patches were taken for stars that trail."""
    assert examined(drawn(sky(), strokes)).reason is Reason.NO_PATTERN_AGREED


def test_out_of_focus() -> None:
    found = examined(sky(25, fwhm_px=18.0))
    assert found.reason is Reason.OUT_OF_FOCUS
    assert found.measured["half_flux_diameter_px"] > 12


def test_half_flux_diameter_of_a_gaussian_is_near_its_width() -> None:
    frame = sky(fwhm_px=5.0)
    found = DETECTORS.make("auto").detect(frame)
    # 2 <r> of a Gaussian is sqrt(2 pi) sigma = 1.06 FWHM
    assert half_flux_diameter_px(frame, found) == pytest.approx(5.3, rel=0.2)


def test_the_moon() -> None:
    frame = sky(8)
    y, x = np.mgrid[:H, :W]
    lit = np.where((x - 300) ** 2 + (y - 200) ** 2 < 60**2, 65535, frame.pixels)
    found = examined(Frame(lit.astype(np.uint16), saturation=65535.0))
    assert found.reason is Reason.TOO_FEW_STARS
    assert "Moon" in found.advice


def test_too_few() -> None:
    found = examined(sky(3))
    assert found.reason is Reason.TOO_FEW_STARS
    assert f"Only {found.detections} stars" in found.advice


def test_a_field_too_small_is_told_from_the_scale() -> None:
    found = examined(sky(30), Hint(scale_arcsec_px=(0.9, 1.1)))
    assert found.reason is Reason.FIELD_TOO_SMALL
    assert found.measured["field_deg"] == pytest.approx(0.22, abs=0.01)
    assert found.measured["stars_expected"] < 5


def test_the_stars_expected_are_those_of_the_place() -> None:
    expected = {}
    for name, place in (("milky way", (300.0, 35.0, 1.0)), ("pole of it", (192.86, 27.13, 1.0))):
        hint = Hint(scale_arcsec_px=(9.0, 11.0), centre_deg=place)
        expected[name] = examined(sky(30), hint).measured["stars_expected"]
    assert expected["milky way"] > 2 * expected["pole of it"] > 20


def test_a_fisheye_is_told_from_the_scale() -> None:
    found = examined(sky(), Hint(scale_arcsec_px=(700.0, 1300.0)))
    assert found.reason is Reason.DISTORTION_TOO_STRONG


def test_the_implied_field() -> None:
    stars = Detections.from_list(np.zeros((3, 2)), 3600, 2400)
    hint = Hint(scale_arcsec_px=(1.0, 1.0))
    assert implied_field_deg(Evidence(stars, hint)) == pytest.approx(1.0, abs=1e-4)
    assert implied_field_deg(Evidence(stars)) is None


def test_a_bare_list_is_diagnosed_without_a_frame() -> None:
    stars = Detections.from_list(np.random.default_rng(0).uniform(0, 500, (30, 2)), 500, 500)
    found = diagnose(Evidence(stars), None, {})
    assert found.reason is Reason.NO_PATTERN_AGREED
    assert "y runs down" in found.advice
    few = diagnose(Evidence(stars.take(slice(0, 4))), None, {})
    assert few.reason is Reason.TOO_FEW_STARS


def test_what_the_identifier_said_is_kept_when_the_frame_is_healthy() -> None:
    said = NoSolution(Reason.DISTORTION_TOO_STRONG, "Crop it.", "40 patterns")
    stars = Detections.from_list(np.random.default_rng(0).uniform(0, 500, (30, 2)), 500, 500)
    found = diagnose(Evidence(stars), said, {"total": 1.0})
    assert (found.reason, found.advice, found.tried) == (said.reason, "Crop it.", "40 patterns")


def test_what_a_method_lacks_is_its_own_advice_even_where_no_pattern_agreed() -> None:
    """Without anything tried there was no search whose failure the frame could explain."""
    said = NoSolution(Reason.NO_PATTERN_AGREED, "Give the pixel scale.", "nothing: the scale is not known")
    assert not said.searched
    stars = Detections.from_list(np.random.default_rng(0).uniform(0, 500, (30, 2)), 500, 500)
    assert diagnose(Evidence(stars), said, {}).advice == "Give the pixel scale."


def test_every_end_has_advice_and_finite_numbers() -> None:
    empty = Detections.from_list(np.zeros((0, 2)), W, H)
    ends = [
        diagnose(Evidence(empty), NoSolution(Reason.TIMED_OUT, "Allow more time.", "searched for 3 s"), {}),
        diagnose(Evidence(empty, None, sky(0)), None, {}),
        diagnose(Evidence(empty, Hint(scale_arcsec_px=(1, 2)), sky(5)), None, {}),
    ]
    for end in ends:
        assert end.advice.endswith((".", "!"))
        json.dumps(dict(end.measured), allow_nan=False)


def test_unusual_pixels_are_measured_too() -> None:
    pixels = np.full((40, 50), np.nan, np.float32)
    pixels[::2] = -1.0
    found = diagnose(Evidence(Detections.from_list(np.zeros((0, 2)), 50, 40), None, Frame(pixels)), None, {})
    json.dumps(dict(found.measured), allow_nan=False)
    tiny = Frame(np.zeros((1, 1), np.uint8))
    none = Detections.from_list(np.zeros((0, 2)), 1, 1)
    assert diagnose(Evidence(none, None, tiny), None, {}).reason is Reason.CLOUDED_OR_DARK


def test_bins_are_the_mean_of_their_pixels() -> None:
    pixels = np.random.default_rng(1).integers(0, 65535, (2403, 3607)).astype(np.uint16)
    bins = binned(Frame(pixels))
    assert bins.step == 3
    expected = pixels[:2403, :3606].reshape(801, 3, 1202, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(bins.image, expected, rtol=1e-6)
    assert binned(Frame(pixels[:50, :60], bayer="RGGB")).step == 2
