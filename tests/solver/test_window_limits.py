"""Where a window's verdict turns: how bright, how wide, how many, how far off, each from both sides."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.attitude.filter import begin
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.detection.windows import WindowStars, look
from kochab.identification.predictional_estimate import Estimate
from kochab.identification.verification import least_likely
from kochab.solver import track_windows
from kochab.solver.track_prediction import Expected, Prediction
from kochab.solver.track_windows import Tracked, TrackedStarImage, WindowSearch, WindowSearchResult, match

from .test_track_look import GRID, IMAGE, NOISE, SIGMA, frame, sky

CAMERA = Camera.centred(640, 480, 3000.0)


def peak_of(snr):
    """A Gaussian's light over the noise in its own shape is its peak over the noise, times its width and root pi."""
    return snr * NOISE / (SIGMA * np.sqrt(np.pi))


# -- What is a star, and what its image ---------------------------------------------------------------


@pytest.mark.parametrize(("wide", "found"), [(6.7, True), (7.3, False)])
def test_the_middle_of_a_trail_of_more_than_seven_pixels_rms_is_not_known(wide, found) -> None:
    places = GRID[(GRID[:, 0] > 60) & (GRID[:, 0] < 260)][::3]
    pixels = frame(sky(places, [900.0] * len(places), sigma=(wide, SIGMA)))
    seen = look(pixels, places, 30, np.diag([wide**2, SIGMA**2]))
    assert bool(seen.found.any()) is found


@pytest.mark.parametrize(
    ("count", "snr", "measured"), [(2, 40.0, False), (3, 40.0, True), (5, 13.0, False), (5, 19.0, True)]
)
def test_three_stars_of_fifteen_sigmas_tell_the_image(count, snr, measured) -> None:
    seen = look(frame(sky(GRID[:count], [peak_of(snr)] * count)), GRID[:count], 9, IMAGE)
    assert bool(np.isfinite(seen.moments).all()) is measured


@pytest.mark.parametrize(
    ("count", "wide", "changed"),
    [
        (4, 2.6, True),
        (3, 2.6, False),
        (35, 1.65, False),
        (35, 1.85, True),
        (35, 0.85, True),
        (35, 1.05, False),
        (35, 0.7, True),
        (35, 0.62, False),
    ],
)
def test_four_bright_stars_show_another_image_when_it_is_not_half_as_large_again(count, wide, changed) -> None:
    """The ratio of the variances must pass 1.8 either way: 1.74 and 0.97 px beside 1.3 px; what is a pixel is none."""
    pixels = frame(sky(GRID[:count], [3000.0] * count, sigma=(wide, wide)))
    plain, adapted = (look(pixels, GRID[:count], 12, IMAGE, adapt=adapt) for adapt in (False, True))
    assert np.allclose(plain.snr, adapted.snr) is not changed


def test_faint_stars_do_not_change_the_image() -> None:
    """A peak of ten times the noise of a smoothed pixel is needed."""
    changed = []
    for peak in (40.0, 250.0):
        pixels = frame(sky(GRID, [peak] * len(GRID), sigma=(2.6, 2.6)))
        plain, adapted = (look(pixels, GRID, 12, IMAGE, adapt=adapt) for adapt in (False, True))
        changed.append(not np.allclose(plain.snr, adapted.snr))
    assert changed == [False, True]


def test_the_noise_of_a_window_is_its_own_and_a_silent_one_has_a_third_of_the_usual() -> None:
    """A window that is all one value, of a masked or clipped part, must not make its dust into stars."""
    pixels = sky(GRID, [200.0] * len(GRID))
    x, y = GRID[8].round().astype(int)
    y0, x0 = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    star = 200.0 * np.exp(-0.5 * ((x0 - GRID[8][0]) ** 2 + (y0 - GRID[8][1]) ** 2) / SIGMA**2)
    near = np.s_[y - 14 : y + 15, x - 14 : x + 15]
    pixels[near] = 400.0 + star[near]
    seen = look(frame(pixels), GRID, 9, IMAGE)
    usual = np.median(np.delete(seen.snr, 8))
    assert seen.snr[8] == pytest.approx(usual / 0.3, rel=0.1)


# -- What windows agree on ----------------------------------------------------------------------------


def seen_at(xy, sigma=0.1):
    n = len(xy)
    return WindowStars(xy, np.full(n, sigma), np.full(n, 30.0), np.ones(n, bool), np.full(3, np.nan))


def around(count):
    """Unit vectors (count, 2) in all directions, in no order."""
    angle = np.random.default_rng(9).permutation(count) * 2.0 * np.pi / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def field(count, seed=6):
    places = np.random.default_rng(seed).uniform(20, [620, 460], (count, 2))
    return places, CAMERA.unproject(places)


@pytest.mark.parametrize(("noise_px", "found"), [(1.1, True), (1.3, False)])
def test_windows_whose_residuals_pass_a_pixel_and_a_fifth_do_not_agree(noise_px, found) -> None:
    """All stars are off alike, in all directions: the RMS of a coordinate is their distance over root two."""
    places, vectors = field(40)
    xy = places + np.sqrt(2.0) * noise_px * around(40)
    answer = match(CAMERA, np.eye(3), vectors, places, seen_at(xy, noise_px), 16)
    assert (answer is not None) is found


def test_a_large_error_of_roll_is_found_when_it_is_allowed_for() -> None:
    """Turned about the middle by 30 px at the corner, no two windows share one shift."""
    places, vectors = field(30)
    angle = 30.0 / 400.0
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = np.array([319.5, 239.5])
    xy = middle + (places - middle) @ turn.T
    found = match(CAMERA, np.eye(3), vectors, places, seen_at(xy), 40, 30.0)
    assert found is not None
    assert len(found.estimate.star) == 30
    matrix = found.estimate.attitude.matrix
    assert abs(np.arctan2(matrix[0, 1], matrix[0, 0])) == pytest.approx(angle, rel=1e-3)


def test_each_look_makes_chance_that_much_likelier_and_a_larger_window_less_likely_to_agree() -> None:
    places, vectors = field(12)
    seen = seen_at(places + around(12), 0.7)
    bounds = {
        (half, looks): match(CAMERA, np.eye(3), vectors, places, seen, half, looks=looks)
        for half, looks in ((12, 1), (12, 3), (25, 1))
    }
    one, three, large = (found.log10_false_alarm for found in bounds.values())
    assert three == pytest.approx(one + np.log10(3.0))
    assert large < one


@pytest.mark.parametrize(("finds", "agree", "found"), [(3, 3, False), (4, 4, True), (24, 12, True), (26, 12, False)])
def test_half_of_the_finds_and_four_must_agree(finds, agree, found) -> None:
    places, vectors = field(finds)
    rng = np.random.default_rng(3)
    far = rng.choice([-1.0, 1.0], (finds - agree, 2)) * rng.uniform(9.0, 24.0, (finds - agree, 2))
    xy = places.copy()
    xy[agree:] += far
    answer = match(CAMERA, np.eye(3), vectors, places, seen_at(xy), 25)
    assert (answer is not None) is found


# -- When a second look is worth it, and when it is better ----------------------------------------------


def result(seen, sigma_px, windows=20, alarm=-9.0):
    index = np.arange(seen)
    estimate = Estimate(Attitude(np.eye(3)), index, index, np.zeros((seen, 2)), sigma_px)
    stars = Expected(np.arange(windows), np.zeros((windows, 2)))
    return WindowSearchResult(None, None, stars, None, Tracked(estimate, alarm))


@pytest.mark.parametrize(
    ("seen", "sigma_px", "poor"), [(14, 0.4, False), (13, 0.4, True), (20, 0.51, True), (20, 0.49, False)]
)
def test_a_look_is_poor_with_less_than_seven_tenths_of_its_stars_or_half_a_pixel(seen, sigma_px, poor) -> None:
    assert result(seen, sigma_px).poor is poor


@pytest.mark.parametrize(
    ("seen", "sigma_px", "better"),
    [
        (11, 0.6, True),
        (10, 0.6, False),
        (10, 0.4, True),
        (6, 0.4, True),
        (5, 0.4, False),
        (9, 0.5, False),
        (9, 0.6, False),
    ],
)
def test_a_second_look_is_better_with_more_stars_or_sharper_with_more_than_half(seen, sigma_px, better) -> None:
    """Its bound is that of the first, which had no help."""
    first, again = result(10, 0.5, alarm=-7.0), result(seen, sigma_px, alarm=-30.0)
    chosen = first.better_of(again)
    assert (chosen.found.estimate is again.found.estimate) is better
    assert chosen.found.log10_false_alarm == -7.0
    assert first.better_of(None) is first


def test_a_star_image_of_the_frame_is_sharp_when_only_so_its_stars_are_found() -> None:
    """Half of forty known stars must be seen; single pixels are seen only as sharp ones."""
    from kochab.core.frame import Detections

    detections = replace(Detections.from_list(np.zeros((6, 2)), 320, 240), fwhm_px=np.full(6, 3.0))
    pixels = sky(np.zeros((0, 2)), [])
    whole = GRID.round()
    for x, y in whole.astype(int):
        pixels[y, x] += 400.0
    sharp = TrackedStarImage.of(detections, frame(pixels), whole)
    assert sharp.sharp
    assert sharp.size_px2 == pytest.approx(0.36 - 1.0 / 12.0)
    assert not TrackedStarImage.of(detections, frame(pixels), whole[:4]).sharp  # too few to tell
    assert not TrackedStarImage.of(detections, frame(sky(GRID, [300.0] * len(GRID))), GRID).sharp
    assert not TrackedStarImage.of(detections, frame(sky(GRID[:0], [])), GRID).sharp  # nothing there


@pytest.mark.parametrize(("off_px", "agrees"), [(2.9, True), (3.1, False)])
def test_a_find_three_pixels_off_is_another_star_however_unsure_it_is(off_px, agrees) -> None:
    places, vectors = field(40)
    seen = seen_at(places.copy())
    seen.xy[7, 0] += off_px
    seen.sigma_px[7] = 2.0
    answer = match(CAMERA, np.eye(3), vectors, places, seen, 16, 2.0)
    assert (7 in answer.estimate.seen) is agrees
    assert len(answer.estimate.seen) == 39 + agrees


def test_the_bound_is_that_of_the_distances_in_windows_of_a_side() -> None:
    places, vectors = field(12)
    seen = seen_at(places + 0.7 * around(12), 0.7)
    found = match(CAMERA, np.eye(3), vectors, places, seen, 16, looks=2)
    left = seen.xy - CAMERA.project(vectors @ found.estimate.attitude.matrix.T)
    distance2 = np.sum(left**2, axis=1)
    assert np.median(distance2) > 0.3
    expected, _ = least_likely(distance2, 12, 1, 33.0**2, 16.0, candidates=2, free=3)
    assert found.log10_false_alarm == pytest.approx(expected, rel=1e-6)


def test_windows_with_nothing_in_them_are_no_finds() -> None:
    seen = look(frame(sky([], [])), np.zeros((0, 2)), 9, IMAGE)
    assert (seen.xy.shape, seen.sigma_px.shape, seen.snr.shape) == ((0, 2), (0,), (0,))
    assert (seen.found.shape, seen.found.dtype) == ((0,), np.bool_)
    assert seen.moments.shape == (3,)
    assert np.isnan(seen.moments).all()


def test_the_twelve_brightest_finds_tell_the_image() -> None:
    """They are smeared, the others are not: whoever counts the others sees nothing new."""
    peaks = np.where(np.arange(len(GRID)) % 3 == 0, 3000.0, 500.0)
    wide = np.arange(len(GRID)) % 3 == 0
    assert wide.sum() == 12
    pixels = sky(GRID[wide], peaks[wide], sigma=(2.6, 2.6)) + sky(GRID[~wide], peaks[~wide], noise=0.0) - 400.0
    plain, adapted = (look(frame(pixels), GRID, 12, IMAGE, adapt=adapt) for adapt in (False, True))
    assert not np.allclose(plain.snr, adapted.snr)


class Asked:
    """A sky without stars that keeps what it is asked for."""

    def __init__(self):
        self.calls = []

    def expected(self, *asked):
        self.calls.append(asked)
        return Expected(np.zeros(0, np.int64), np.zeros((0, 2)))


def test_stars_are_looked_for_from_four_pixels_inside_the_frame_on_and_five_at_least() -> None:
    asked = Asked()
    search = WindowSearch(frame(sky([], [])), CAMERA, TrackedStarImage(), 40)
    ahead = replace(begin(Attitude(np.eye(3), np.eye(3)), 0.0), step_s=0.1)
    assert search.at(Prediction(ahead, 12, 3.0), asked) is None
    assert [(camera, count, inset) for camera, _, count, inset in asked.calls] == [(CAMERA, 40, 4.0)] * 2
    assert search.looks == 0


# -- How often a frame is looked at, and how --------------------------------------------------------------


class Five:
    """A sky of so many stars, wherever one looks."""

    def __init__(self, count=5):
        self.vectors = CAMERA.unproject(np.full((count, 2), 200.0))
        self.sigma_rad = np.full(count, 1e-4)  # of the catalogue's places: 0.3 px
        self.matrices = []

    def expected(self, _camera, matrix, _count, _inset):
        self.matrices.append(matrix)
        return Expected(np.arange(len(self.vectors)), np.full((len(self.vectors), 2), 200.0))


def agreed(seen, sigma_px=0.3, matrix=None):
    index = np.arange(seen)
    return Tracked(Estimate(Attitude(matrix), index, index, np.zeros((seen, 2)), sigma_px), -9.0)


@pytest.fixture
def looks(monkeypatch):
    """What each look is told, and what each match says in turn."""

    def told(*answers, stars=5, sharp=False):
        calls, left, sky = [], list(answers), Five(stars)
        monkeypatch.setattr(
            track_windows, "look", lambda _f, xy, half, _c, **how: calls.append((half, how)) or seen_at(xy)
        )

        def matched(_camera, matrix, _vectors, _places, _seen, half, roll_px, *, looks):
            calls[-1] += (half, roll_px, looks)
            return left.pop(0)

        monkeypatch.setattr(track_windows, "match", matched)
        search = WindowSearch(frame(sky_of_nothing), CAMERA, TrackedStarImage(sharp=sharp), 40)
        ahead = replace(begin(Attitude(np.eye(3), np.eye(3)), 0.0), step_s=0.1)
        return search.at(Prediction(ahead, 12, 3.0), sky), calls, sky, search.looks

    sky_of_nothing = sky([], [])
    return told


def test_what_is_found_well_is_looked_at_once(looks) -> None:
    found, calls, seen, count = looks(agreed(5))
    assert calls == [(12, {"adapt": False, "sharp": False}, 12, 3.0, 1)]
    assert (found.sky is seen, found.found.log10_false_alarm, count) == (True, -9.0, 1)
    assert found.seen.sigma_px == pytest.approx([np.hypot(0.1, 0.3)] * 5)


def test_what_is_not_found_is_looked_for_again_as_if_it_were_smeared(looks) -> None:
    found, calls, _, count = looks(None, agreed(5))
    assert found is not None
    assert calls[1] == (12, {"adapt": True, "sharp": False}, 12, 3.0, 2)
    nothing, calls, _, count = looks(None, None)
    assert (nothing, len(calls), count) == (None, 2, 2)
    _, calls, _, _ = looks(None, agreed(5), sharp=True)
    assert calls[1][1] == {"adapt": False, "sharp": True}  # single pixels do not smear


def test_what_is_found_poorly_is_looked_at_again_where_it_was_found(looks) -> None:
    """In windows of eight pixels a side, about its own places, with no doubt about the roll."""
    turned = np.diag([-1.0, -1.0, 1.0])
    found, calls, seen, _ = looks(agreed(3, matrix=turned), agreed(5, 0.2))
    assert calls[1] == (8, {"adapt": True, "sharp": False}, 8, 0.0, 2)
    assert (seen.matrices[0] == np.eye(3)).all()
    assert seen.matrices[1] is turned
    assert len(found.found.estimate.seen) == 5
    kept, _, _, _ = looks(agreed(3, matrix=turned), None)
    assert len(kept.found.estimate.seen) == 3


@pytest.mark.parametrize(("stars", "count"), [(4, 0), (5, 1)])
def test_five_stars_must_be_expected_for_a_look(looks, stars, count) -> None:
    found, _, _, made = looks(agreed(stars), stars=stars)
    assert (found is not None, made) == (count > 0, count)
