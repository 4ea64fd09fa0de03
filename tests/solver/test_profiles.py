import json
import re
from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import Attitude, attitude_from, small_rotation
from kochab.core.camera import Camera
from kochab.core.errors import KochabError
from kochab.solver.camera_profile import (
    doubt,
    evidence,
    load_profile,
    new_profile,
    profile_folder,
    profile_path,
    save_profile,
    updated_profile,
)

TRUTH = Camera(1280, 960, 3000.0, 650.0, 470.0, k1=-0.15, p1=0.0005)
SIGMA = 0.1


def seen(camera, rng, count=60, sigma=SIGMA):
    """Stars of one frame and its attitude, a little off."""
    xy = rng.uniform(5, [camera.width - 5, camera.height - 5], (count, 2))
    ra, dec, roll = rng.uniform(0, 360), rng.uniform(-80, 80), rng.uniform(-180, 180)
    attitude = attitude_from(ra, dec, roll)
    vectors = camera.unproject(xy) @ attitude.matrix
    off = small_rotation(rng.normal(0, 1e-4, 3)) @ attitude.matrix
    return xy + rng.normal(0, sigma, xy.shape), vectors, Attitude(off)


def learned(frames, rng, start=None, camera=TRUTH):
    profile = start or new_profile("lens", Camera.centred(1280, 960, 3010.0))
    for _ in range(frames):
        profile = updated_profile(profile, evidence(profile, *seen(camera, rng), SIGMA))
    return profile


def test_the_camera_is_found_over_frames_as_well_as_it_says() -> None:
    rng = np.random.default_rng(1)
    few, many = learned(3, rng), learned(60, rng)
    for profile in (few, many):
        for name, sigma in profile.sigma.items():
            assert abs(getattr(profile.camera, name) - getattr(TRUTH, name)) < 4.5 * sigma, name
    assert many.sigma["focal_px"] < few.sigma["focal_px"] / 3
    assert many.sigma["focal_px"] < 0.3
    assert many.sigma["cx"] < 5.0
    assert many.frames == 60


def test_a_narrow_field_says_little_of_the_principal_point() -> None:
    narrow = Camera.centred(1280, 960, 200_000.0)
    rng, profile = np.random.default_rng(2), new_profile("scope", narrow)
    for _ in range(20):
        profile = updated_profile(profile, evidence(profile, *seen(narrow, rng), SIGMA))
    assert profile.sigma["cx"] > 10.0
    assert abs(profile.camera.cx - narrow.cx) < 2.0 * profile.sigma["cx"]
    assert profile.sigma["focal_px"] / narrow.focal_px < 1e-4


def test_frames_that_agree_do_not_contradict_and_a_refocused_lens_does() -> None:
    rng = np.random.default_rng(3)
    profile = learned(30, rng)
    for _ in range(30):
        told = evidence(profile, *seen(TRUTH, rng), SIGMA)
        assert not told.contradicts
        assert doubt(profile, told) == ""
    moved = replace(TRUTH, focal_px=3030.0)
    told = evidence(profile, *seen(moved, rng), SIGMA)
    assert told.contradicts
    assert told.focal_px == pytest.approx(3030.0, abs=3.0)
    assert "Your camera profile is off" in doubt(profile, told)
    assert "3030" in doubt(profile, told) or "3029" in doubt(profile, told)


def test_a_difference_nobody_would_notice_is_no_contradiction() -> None:
    rng = np.random.default_rng(4)
    profile = learned(30, rng)
    told = evidence(profile, *seen(replace(TRUTH, focal_px=3000.4), rng), SIGMA)
    assert not told.contradicts


def test_old_frames_fade_so_that_a_cooling_lens_is_followed() -> None:
    rng = np.random.default_rng(5)
    profile = replace(learned(20, rng), frames=400)
    before = profile.information[0, 0]
    told = evidence(profile, *seen(TRUTH, rng), SIGMA)
    nothing = replace(told, information=np.zeros((7, 7)), vector=np.zeros(7))
    assert updated_profile(profile, nothing).information[0, 0] == pytest.approx(before * (1 - 1 / 400))


def test_the_hint_holds_the_truth_and_is_narrow() -> None:
    profile = learned(20, np.random.default_rng(6))
    low, high = profile.hint.scale_arcsec_px
    assert low < TRUTH.scale_arcsec_px < high
    assert high / low < 1.03
    assert profile.suits(TRUTH)
    assert not profile.suits(replace(TRUTH, mirrored=True))


def test_kept_and_recalled(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    profile = learned(5, np.random.default_rng(7))
    assert load_profile("lens", 1280, 960) is None
    path = save_profile(profile)
    assert path.parent == profile_folder() == tmp_path / "config" / "cameras"
    again = load_profile("lens", 1280, 960)
    assert again.camera == profile.camera
    assert np.array_equal(again.information, profile.information)
    assert json.loads(path.read_text())["sigma"]["focal_px"] > 0
    assert list(profile_folder().glob("*.json")) == [path]
    assert load_profile("lens", 640, 480) is None
    assert profile_path("a/b", 1, 1) != profile_path("a b", 1, 1)


def test_what_cannot_be_read_or_written_is_said_in_a_sentence(tmp_path) -> None:
    profile = new_profile("lens", TRUTH)
    path = save_profile(profile, tmp_path)
    told = path.read_text()
    for damaged in ("{", told.replace("1280", "1281")):
        path.write_text(damaged)
        with pytest.raises(KochabError, match="not a camera profile"):
            load_profile("lens", 1280, 960, tmp_path)
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(KochabError, match="cannot be saved"):
        save_profile(profile, file / "below")


def test_a_new_profile_believes_a_twentieth_of_everything() -> None:
    """Of the focal length and of the frame's long side; distortion by what it does at the corner."""
    camera = Camera.centred(1280, 960, 3000.0)
    sigma = new_profile("lens", camera).sigma
    corner = np.hypot(1280, 960) / 2.0 / 3000.0
    assert sigma["focal_px"] == pytest.approx(150.0)
    assert (sigma["cx"], sigma["cy"]) == (pytest.approx(64.0), pytest.approx(64.0))
    assert sigma["k1"] * corner**2 == pytest.approx(0.1)
    assert sigma["k2"] * corner**4 == pytest.approx(0.1)
    assert (sigma["p1"] * corner, sigma["p2"] * corner) == (pytest.approx(0.01), pytest.approx(0.01))


def test_the_hint_is_a_hundredth_wide_or_five_sigmas() -> None:
    sure, unsure = learned(20, np.random.default_rng(6)), new_profile("lens", TRUTH)
    for profile, factor in ((sure, 1.01), (unsure, 1.25)):
        low, high = profile.hint.scale_arcsec_px
        assert np.sqrt(low * high) == pytest.approx(profile.camera.scale_arcsec_px)
        assert np.sqrt(high / low) == pytest.approx(factor)


def test_frames_add_their_information_until_the_oldest_fade() -> None:
    rng = np.random.default_rng(8)
    profile = learned(3, rng)
    told = evidence(profile, *seen(TRUTH, rng), SIGMA)
    for frames, keep in ((3, 1.0), (399, 1.0), (400, 1.0 - 1.0 / 400.0)):
        after = updated_profile(replace(profile, frames=frames), told)
        np.testing.assert_allclose(after.information, keep * profile.information + told.information)
        assert after.frames == frames + 1


def test_a_frame_twice_as_noisy_says_a_quarter_and_none_is_better_than_a_fiftieth_of_a_pixel() -> None:
    stars = seen(TRUTH, np.random.default_rng(9))
    one, two, best, better = (
        evidence(learned(3, np.random.default_rng(9)), *stars, s) for s in (0.1, 0.2, 0.02, 0.001)
    )
    np.testing.assert_allclose(two.information, one.information / 4.0)
    np.testing.assert_allclose(better.information, best.information)
    np.testing.assert_allclose(best.vector, one.vector * 25.0)


def test_the_chance_of_frames_that_are_right_is_spread_evenly() -> None:
    """Of a profile with its own uncertainty: a tenth of the frames has a chance below a tenth, or fewer."""
    rng = np.random.default_rng(10)
    profile = learned(30, rng)
    chances = np.array([evidence(profile, *seen(TRUTH, rng), SIGMA).chance for _ in range(60)])
    assert 0.35 < np.mean(chances) < 0.85
    assert np.mean(chances < 0.1) < 0.2
    off = [evidence(profile, *seen(replace(TRUTH, cx=650.0 + d), rng), SIGMA) for d in (0.0, 20.0)]
    assert off[1].chance < 1e-6 < off[0].chance


def test_what_a_contradiction_moves_is_told_in_pixels() -> None:
    """A focal length a hundredth longer moves the stars by a hundredth of their distance from the centre."""
    rng = np.random.default_rng(12)
    profile = learned(40, rng)
    xy, vectors, attitude = seen(replace(TRUTH, focal_px=3030.0), rng, 400, 0.02)
    told = evidence(profile, xy, vectors, attitude, 0.02)
    distance = np.sqrt(np.mean(np.sum((xy - [TRUTH.cx, TRUTH.cy]) ** 2, axis=1)))
    assert told.shift_px == pytest.approx(0.01 * distance, rel=0.1)
    for chance, shift, contradicts in ((1e-7, 0.6, True), (1e-7, 0.4, False), (1e-5, 0.6, False)):
        assert replace(told, chance=chance, shift_px=shift).contradicts is contradicts


def test_a_name_makes_a_file_name_whatever_is_in_it(tmp_path) -> None:
    assert profile_path("ASI 294/MC: Pro!", 1280, 960, tmp_path).name.startswith("asi-294-mc-pro-1280x960-")
    assert profile_path("***", 1, 2, tmp_path).name.startswith("camera-1x2-")
    long = profile_path("x" * 300, 1, 2, tmp_path).name
    assert re.fullmatch("x{40}-1x2-[0-9a-f]{8}.json", long)


@pytest.mark.parametrize(
    "change",
    [
        {"terms": ["cx", "log_focal", "cy", "k1", "k2", "p1", "p2"]},
        {"frames": -1},
        {"name": "another"},
        {"information": np.eye(6).tolist()},
        {"information": (-np.eye(7)).tolist()},
        {"information": [[float("nan")] * 7] * 7},
        {"camera": {"focal_px": 0.0}},
        {"camera": {"focal_px": -3000.0}},
        {"camera": {"cx": float("inf")}},
        {"camera": {"height": 961}},
    ],
)
def test_a_file_that_is_no_profile_of_this_camera_is_not_taken_for_one(tmp_path, change) -> None:
    path = save_profile(new_profile("lens", TRUTH), tmp_path)
    kept = json.loads(path.read_text())
    assert (kept["format"], kept["frames"]) == (1, 0)
    assert load_profile("lens", 1280, 960, tmp_path).frames == 0
    if "camera" in change:
        change = {"camera": kept["camera"] | change["camera"]}
    path.write_text(json.dumps(kept | change))
    with pytest.raises(KochabError, match="not a camera profile"):
        load_profile("lens", 1280, 960, tmp_path)


@pytest.mark.parametrize(
    ("log_focal", "cx", "cy"), [(3e-4, 0.0, 0.0), (0.0, 0.9, 0.0), (0.0, 0.0, -0.9), (0.0, 0.0, 0.0)]
)
def test_a_profile_that_is_sure_forgives_what_temperature_does(log_focal, cx, cy) -> None:
    """A ten-thousandth of the focal length and three tenths of a pixel of the centre, one sigma, beside the stars' errors."""
    from scipy.stats import chi2

    sure = replace(new_profile("lens", TRUTH), information=np.eye(7) * 1e16)
    warm = replace(TRUTH, focal_px=3000.0 * np.exp(log_focal), cx=TRUTH.cx + cx, cy=TRUTH.cy + cy)
    told = evidence(sure, *seen(warm, np.random.default_rng(3), 400, 0.05), 0.05)
    spread = np.diag(np.square([1e-4, 0.3, 0.3, 0.0, 0.0, 0.0, 0.0])) + np.eye(7) * 1e-16
    covariance = told.information + told.information @ spread @ told.information
    scale = np.sqrt(np.diag(covariance))
    scaled = told.vector / scale
    square = scaled @ np.linalg.solve(covariance / np.outer(scale, scale), scaled)
    assert told.chance == pytest.approx(chi2.sf(square, 7), rel=1e-3)
    assert told.chance > 1e-3
