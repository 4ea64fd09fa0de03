"""Where a tracked frame is looked at: windows as large as the prediction is unsure, and the star image there."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.attitude.filter import begin
from kochab.core.attitude import ARCSEC, Attitude, attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.detection.windows import WindowStars
from kochab.sky import open_catalogue
from kochab.solver.track_prediction import Neighbourhood, Prediction, predicted_attitudes
from kochab.solver.track_windows import TrackedStarImage, match

CAMERA = Camera.centred(640, 480, 3000.0)
FIRST = attitude_from(84.0, -2.0, 25.0).matrix


def state_with(tilt_px=0.0, roll_px=0.0, rates_rad_s=(0.0, 0.0, 0.0)):
    """A filter sure of its place to so many pixels, by tilts and by roll at the corner, and of its rate."""
    corner = np.hypot(640, 480) / 2.0
    sigma = np.array([tilt_px / CAMERA.focal_px, tilt_px / CAMERA.focal_px, roll_px / corner])
    state = begin(Attitude(FIRST, np.diag(sigma**2)), 0.0)
    state.covariance[3:, 3:] = np.eye(3) * (1e-6 * ARCSEC) ** 2
    return replace(state, rates_rad_s=np.array(rates_rad_s))


def halves(state, time_s=0.0, fwhm_px=2.5):
    return [place.half for place in predicted_attitudes(state, time_s, CAMERA, fwhm_px)]


@pytest.mark.parametrize(
    ("tilt", "roll", "half"),
    [(0.0, 0.0, 8), (1.0, 0.0, 11), (3.0, 0.0, 19), (0.0, 3.0, 19), (3.0, 4.0, 27), (9.0, 0.0, 43), (30.0, 0.0, 64)],
)
def test_windows_hold_four_sigmas_and_the_star(tilt, roll, half):
    """Four sigmas of tilt and roll, two widths of a star and two pixels; 8 px at least."""
    (found, *_) = predicted_attitudes(state_with(tilt, roll), 0.0, CAMERA, 2.5)
    assert found.half == half
    assert found.roll_px == pytest.approx(roll)


def test_beside_the_motion_known_a_mount_that_stands_and_one_that_tracks_are_tried():
    """After a minute the sky has gone a quarter degree: three places, each as likely as the motion says."""
    rate = np.radians([0.0, 0.02, 0.0])
    moving, standing, ground = predicted_attitudes(state_with(rates_rad_s=rate), 60.0, CAMERA, 2.5)
    turns = [np.arccos((np.trace(place.ahead.matrix @ FIRST.T) - 1.0) / 2.0) for place in (moving, standing, ground)]
    assert turns == pytest.approx([np.radians(1.2), 0.0, SIDEREAL_RAD_S * 60.0], abs=1e-7)
    assert standing.half >= 32  # the motion believed was wrong
    for place in (standing, ground):
        assert min(place.ahead.rates_sigma_deg_s) * 3600.0 >= 120.0
    np.testing.assert_allclose(ground.ahead.matrix[:, 2], FIRST[:, 2], atol=1e-9)  # the sky's pole stands still


def test_places_nearer_than_eight_pixels_are_looked_at_once():
    for drift_px, count in ((7.0, 1), (9.0, 2)):
        rate = drift_px / CAMERA.focal_px / 0.1
        seen = halves(state_with(tilt_px=10.0, rates_rad_s=(0.0, rate, 0.0)), 0.1)
        assert len(seen) == count


def test_the_stars_of_a_neighbourhood_are_those_of_the_frame_brightest_first():
    catalogue = open_catalogue()
    camera = Camera.centred(640, 480, 640 / 2 / np.tan(np.radians(6.0)))
    attitude = Attitude(FIRST)
    sky = Neighbourhood(catalogue, camera, attitude, 2026.0, 7.5, 8.0)
    stars = sky.expected(camera, FIRST, 40, 4.0)
    assert (np.diff(sky.mag[stars.number]) >= 0.0).all()
    assert sky.mag[stars.number].max() <= 7.5 < sky.mag.max()
    assert ((stars.xy >= 4.0) & (stars.xy <= [635.0, 475.0])).all()
    assert sky.alone[stars.number].all()
    few = sky.expected(camera, FIRST, 5, 4.0)
    assert few.number.tolist() == stars.number[:5].tolist()
    np.testing.assert_allclose(camera.project(sky.vectors[stars.number] @ FIRST.T), stars.xy, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_star_is_expected_as_near_to_each_edge_as_is_asked_for(axis):
    """Of the first pixel's middle and of the last one's, 639 and 479."""
    camera = Camera.centred(640, 480, 640 / 2 / np.tan(np.radians(6.0)))
    sky = Neighbourhood(open_catalogue(), camera, Attitude(FIRST), 2026.0, 7.5, 8.0)
    stars = sky.expected(camera, FIRST, 4000, 0.0)
    last = np.array([639.0, 479.0])
    for away in (stars.xy, last - stars.xy):
        k = int(
            np.argmin(np.where(away[:, axis] == away.min(axis=1), np.minimum(away, last - away).min(axis=1), np.inf))
        )
        inset = np.minimum(stars.xy[k], last - stars.xy[k]).min()
        assert stars.number[k] in sky.expected(camera, FIRST, 4000, inset - 1e-6).number
        assert stars.number[k] not in sky.expected(camera, FIRST, 4000, inset + 1e-6).number
    assert min(stars.xy[:, axis].min(), (last - stars.xy)[:, axis].min()) >= 0.0


def test_a_neighbourhood_serves_until_the_frame_leaves_it_or_the_scale_changes():
    """It reaches half a field's radius beyond the corners, and a lens may change by a twentieth."""
    camera = Camera.centred(640, 480, 640 / 2 / np.tan(np.radians(6.0)))
    sky = Neighbourhood(open_catalogue(), camera, attitude_from(84.0, 0.0, 0.0), 2026.0, 7.5, 8.0)
    radius = np.degrees(np.arctan(np.hypot(639.0, 479.0) / 2.0 / camera.focal_px))
    assert np.degrees(sky.field_rad) == pytest.approx(radius)
    for share, held in ((0.45, True), (0.55, False)):
        assert sky.covers(camera, attitude_from(84.0, share * radius, 0.0)) is held
    for factor, held in ((1.04, True), (1.06, False), (0.94, False)):
        other = replace(camera, focal_px=camera.focal_px * factor)
        assert sky.covers(other, attitude_from(84.0, 0.0, 0.0)) is held


class TwoStars:
    """A catalogue of a star and its neighbour, so far apart and so much fainter."""

    def __init__(self, apart_arcsec, fainter_mag):
        self.places = unit_vectors(np.array([84.0, 84.0]), np.array([0.0, apart_arcsec / 3600.0]))
        self.mags = np.array([6.0, 6.0 + fainter_mag])

    def cone(self, *_):
        return np.array([0, 1])

    def vectors(self, rows, _year):
        return self.places[rows]

    def mag(self, rows):
        return self.mags[rows]


@pytest.mark.parametrize(
    ("px", "fainter", "alone"),
    [(9.0, 0.0, (True, True)), (7.0, 0.0, (False, False)), (7.0, 2.4, (False, False)), (7.0, 2.6, (True, False))],
)
def test_a_neighbour_disturbs_unless_it_is_far_or_two_and_a_half_magnitudes_fainter(px, fainter, alone):
    sky = TwoStars(px * CAMERA.scale_arcsec_px, fainter)
    found = Neighbourhood(sky, CAMERA, attitude_from(84.0, 0.0, 0.0), 2026.0, 9.0, 8.0)
    assert tuple(found.alone) == alone


# -- The image of a star -------------------------------------------------------------------------


def going(rate_px_s=0.0, axis=0):
    """A prediction whose stars move at so many px a second, by a turn about x or y."""
    rates = np.zeros(3)
    rates[axis] = rate_px_s / CAMERA.focal_px
    return Prediction(state_with(rates_rad_s=rates), 8, 0.0)


def windows(xx, yy):
    one = np.zeros(1)
    return WindowStars(np.zeros((1, 2)), one, one, np.ones(1, dtype=bool), np.array([xx, yy, 0.0]))


def test_a_star_is_smeared_along_its_motion_by_a_twelfth_of_the_trails_square():
    image = TrackedStarImage(1.5)
    np.testing.assert_allclose(image.during(going(), CAMERA, 0.1), 1.5 * np.eye(2))
    np.testing.assert_allclose(image.during(going(60.0, 0), CAMERA, 0.1), np.diag([1.5, 1.5 + 3.0]))
    np.testing.assert_allclose(image.during(going(60.0, 1), CAMERA, 0.1), np.diag([1.5 + 3.0, 1.5]))
    np.testing.assert_allclose(image.during(going(9.0), CAMERA, 0.1), 1.5 * np.eye(2))  # below a pixel
    np.testing.assert_allclose(image.during(going(60.0), CAMERA, None), 1.5 * np.eye(2))
    turning = Prediction(state_with(rates_rad_s=np.array([60.0, 60.0, 0.0]) / CAMERA.focal_px), 8, 0.0)
    plain, mirrored = (image.during(turning, c, 0.1)[0, 1] for c in (CAMERA, replace(CAMERA, mirrored=True)))
    assert plain == pytest.approx(-3.0)  # x to the left, y down
    assert mirrored == pytest.approx(3.0)


def test_seeing_is_followed_by_a_tenth_a_frame_and_by_a_twentieth_at_most():
    for seen, after in ((1.8, 1.5 + 0.1 * 0.2), (9.0, 1.5 + 0.05), (0.3, 1.5 - 0.05)):
        image = TrackedStarImage(1.5)
        image.learn(windows(seen, seen), going(), CAMERA, 0.1)
        assert image.size_px2 == pytest.approx(after)
    oval = TrackedStarImage(1.5)
    oval.learn(windows(1.2, 1.8 * 1.8 / 1.2), going(), CAMERA, 0.1)
    assert oval.size_px2 == pytest.approx(1.52)


def test_trails_sharp_stars_and_empty_windows_teach_nothing_of_the_seeing():
    for image, seen, place in (
        (TrackedStarImage(1.5), windows(3.0, 3.0), going(15.0)),
        (TrackedStarImage(1.5, sharp=True), windows(3.0, 3.0), going()),
        (TrackedStarImage(1.5), windows(np.nan, np.nan), going()),
        (TrackedStarImage(1.5), windows(-1.0, -1.0), going()),
    ):
        image.learn(seen, place, CAMERA, 0.1)
        assert image.size_px2 == 1.5
    slow = TrackedStarImage(1.5)
    slow.learn(windows(3.0, 3.0), going(9.0), CAMERA, 0.1)
    assert slow.size_px2 > 1.5


def test_the_first_image_is_that_of_the_detections_that_are_not_clipped():
    plain = Detections.from_list(np.zeros((6, 2)), 640, 480)
    found = replace(
        plain, fwhm_px=np.array([9.0, 3.0, 3.2, np.nan, 2.8, 3.0]), saturated=np.array([True] + [False] * 5)
    )
    image = TrackedStarImage.of(found, None, np.zeros((0, 2)))
    assert image.fwhm_px == pytest.approx(3.0, rel=1e-6)
    assert TrackedStarImage.of(plain, None, np.zeros((0, 2))).fwhm_px == pytest.approx(2.8, rel=1e-6)
    tiny = TrackedStarImage.of(replace(plain, fwhm_px=np.full(6, 0.1)), None, np.zeros((0, 2)))
    assert tiny.size_px2 == pytest.approx(0.36 - 1.0 / 12.0)


# -- What windows agree on -----------------------------------------------------------------------


def looked(count, good, rng, offset_px=(3.0, -2.0), half=12):
    """Windows of which ``good`` show their stars, all off alike; the others show anything."""
    expected = rng.uniform(20, [620, 460], (count, 2))
    vectors = CAMERA.unproject(expected)
    xy = expected + offset_px + rng.normal(0.0, 0.1, (count, 2))
    xy[good:] = expected[good:] + rng.uniform(-half, half, (count - good, 2))
    seen = WindowStars(xy, np.full(count, 0.1), np.full(count, 30.0), np.ones(count, dtype=bool), np.full(3, np.nan))
    return match(CAMERA, np.eye(3), vectors, expected, seen, half)


def test_windows_that_agree_give_the_turn_that_moves_their_stars():
    found = looked(20, 16, np.random.default_rng(6))
    assert set(found.estimate.star.tolist()) >= set(range(16))
    middle = CAMERA.project(np.array([[0.0, 0.0, 1.0]]) @ found.estimate.attitude.matrix.T)[0]
    assert middle - [319.5, 239.5] == pytest.approx([3.0, -2.0], abs=0.15)
    assert found.estimate.sigma_px == pytest.approx(0.1, abs=0.08)
    assert found.log10_false_alarm < -10.0


def test_fewer_than_half_of_the_finds_are_no_agreement():
    assert looked(20, 12, np.random.default_rng(6)) is not None
    assert looked(40, 14, np.random.default_rng(6)) is None
    assert looked(3, 3, np.random.default_rng(6)) is None


def test_a_neighbourhood_of_a_very_wide_field_ends_short_of_a_quarter_of_the_sky() -> None:
    wide = Camera.centred(640, 480, 250.0)
    sky = Neighbourhood(open_catalogue(), wide, Attitude(FIRST), 2026.0, 4.0, 8.0)
    assert sky.field_rad > 1.0
    assert sky.radius == 1.5
