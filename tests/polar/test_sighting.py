"""A frame's attitude is that of fixed pixels, whatever its fit took for centre and distortion."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.attitude.fit import refine
from kochab.core.attitude import Attitude, angle_between, attitude_from, rotation_vector, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Matches
from kochab.polar.live import LivePhase
from kochab.polar.measure import MeasureSettings, measure
from kochab.polar.sighting import Sighting, covariance_of, to_local
from tests.polar.displaced import ARCSEC, displaced, solution

WHEN = datetime(2025, 3, 14, 21, 30, tzinfo=UTC)
SETTINGS = MeasureSettings(Site(40.0, 11.5, 520.0))

LENS = Camera(2256, 1504, 48925.0, 1180.0, 720.0, k1=4.1)
"""Of 2.6 deg, decentred and distorted as a real DSLR's is (k1 of 4 is 0.1 % at the corners)."""

CENTRES_PX = ((180.0, -130.0), (-95.0, 60.0), (-150.0, -40.0), (40.0, 170.0))


def swept(camera, turns_deg=(0.0, 45.0, 90.0)):
    """Frames of a camera that turned about an axis half a degree from the celestial pole."""
    axis = unit_vectors(100.0, 89.5)
    first = attitude_from(40.0, 75.0, 20.0).matrix
    turns = (Rotation.from_rotvec(axis * np.radians(t)).as_matrix() for t in turns_deg)
    return [solution(camera, first @ turn.T) for turn in turns]


def refitted(found):
    """The same frames; the optical centre of each fit moved another way, by 8 to 16 arcmin.

    The maps from pixels to sky stay the same, within 1.5 arcsec at the worst corner.
    """
    others = []
    for one, centre in zip(found, CENTRES_PX, strict=False):
        other, apart = displaced(one, *centre)
        assert apart < 1.5 * ARCSEC
        assert angle_between(one.attitude.boresight, other.attitude.boresight) > 400.0 * ARCSEC
        others.append(other)
    return others


def sightings(found):
    return [Sighting.of(s, WHEN + timedelta(seconds=60 * k)) for k, s in enumerate(found)]


@pytest.mark.parametrize("mirrored", [False, True])
def test_an_attitude_does_not_move_with_the_fitted_optical_centre(mirrored):
    camera = Camera(2256, 1504, 48925.0, 1180.0, 720.0, k1=4.1, mirrored=mirrored)
    found = swept(camera)
    pairs = zip(sightings(found), sightings(refitted(found)), strict=True)
    for one, other in pairs:
        for a, b in (
            (one.attitude.matrix, other.attitude.matrix),
            *[[to_local(s, SETTINGS.site).matrix.T for s in (one, other)]],
        ):
            tilt_x, tilt_y, roll = np.abs(rotation_vector(a @ b.T)) / ARCSEC
            assert max(tilt_x, tilt_y) < 0.3
            assert roll < 1.0


def test_the_axis_does_not_move_with_the_fitted_optical_centres():
    found = swept(LENS)
    right, other = (measure(sightings(s), SETTINGS) for s in (found, refitted(found)))
    assert angle_between(right.error.axis, other.error.axis) < 1.0 * ARCSEC
    # and nothing more is said to have moved
    assert [f.kind for f in other.findings] == [f.kind for f in right.findings]


def test_the_live_error_does_not_move_with_the_fitted_optical_centre():
    *found, last = swept(LENS, (0.0, 45.0, 90.0, 90.0))
    live = LivePhase(measure(sightings(found), SETTINGS))
    moved, _ = displaced(last, *CENTRES_PX[3])
    right, other = (
        live.update(to_local(Sighting.of(s, WHEN + timedelta(seconds=200)), SETTINGS.site)) for s in (last, moved)
    )
    assert angle_between(right.error.axis, other.error.axis) < 1.0 * ARCSEC


def test_a_binned_frame_shows_the_same_place():
    whole = swept(LENS)[0]
    binned = Camera(1128, 752, 48925.0 / 2, (1180.0 - 0.5) / 2, (720.0 - 0.5) / 2, k1=4.1)
    half = solution(binned, whole.attitude.matrix)
    gap = Sighting.of(whole, WHEN).attitude.matrix @ Sighting.of(half, WHEN).attitude.matrix.T
    assert np.abs(rotation_vector(gap)).max() < 0.01 * ARCSEC


@pytest.mark.parametrize(
    ("camera", "stars"), [(LENS, 150), (Camera(2256, 1504, 6000.0, 1180.0, 720.0, -0.12, 0.05, 0.001, -0.0008), 150)]
)
def test_the_covariance_is_what_fits_of_one_field_scatter_by(camera, stars):
    """Stars of known places through the real fit: the optical axis strays by arcminutes in it."""
    rng = np.random.default_rng(1)
    attitude = attitude_from(120.0, 50.0, 20.0)
    right = Sighting.of(solution(camera, attitude.matrix), WHEN).attitude.matrix
    guess = Camera.centred(camera.width, camera.height, camera.focal_px)
    sigmas, strays = [], []
    for _ in range(60):
        xy = rng.uniform([0.0, 0.0], [camera.width - 1.0, camera.height - 1.0], (stars, 2))
        sky = camera.unproject(xy) @ attitude.matrix
        seen = xy + rng.normal(scale=0.15, size=xy.shape)
        number = np.arange(stars)
        fit = refine(Matches(number, number, seen, sky), guess, attitude)
        found = Sighting.of(solution(fit.camera, fit.attitude.matrix, fit.attitude.covariance), WHEN)
        off = rotation_vector(found.attitude.matrix @ right.T)
        sigmas.append(off / np.sqrt(np.diag(found.attitude.covariance)))
        strays.append(angle_between(fit.attitude.boresight, attitude.boresight) / ARCSEC)
    assert np.median(strays) > 30.0
    share = np.sqrt(np.mean(np.square(sigmas), axis=0))
    assert share.min() > 0.4
    assert share.max() < 1.8


def test_no_frame_is_surer_than_the_seeing_and_a_poor_one_no_surer_than_its_solve():
    """Seven tenths of an arcsecond on each axis, added in squares to what the solve says."""
    perfect = Sighting.of(solution(LENS, np.eye(3), np.zeros((3, 3))), WHEN)
    sigma = np.sqrt(np.diag(to_local(perfect, SETTINGS.site).covariance)) / ARCSEC
    assert sigma == pytest.approx([0.7, 0.7, 0.7])
    poor = Attitude(np.eye(3), np.diag(np.square([3.0, 4.0, 60.0])) * ARCSEC**2)
    sigma = np.sqrt(np.diag(covariance_of(poor))) / ARCSEC
    assert sigma == pytest.approx([np.hypot(3.0, 0.7), np.hypot(4.0, 0.7), np.hypot(60.0, 0.7)])
    with pytest.raises(ValueError, match="covariance"):
        covariance_of(Attitude(np.eye(3)))


@pytest.mark.parametrize("k1", [-0.2, 0.0, 0.2])
def test_the_plain_camera_is_as_wide_as_the_middle_of_the_frame_on_the_sky(k1):
    """A lens of 45 deg: what its distortion does at the edges is no part of its scale."""
    lens = Camera(2256, 1504, 2700.0, 1300.0, 600.0, k1=k1)
    sighting = Sighting.of(solution(lens, np.eye(3)), WHEN)
    west, east = lens.unproject(np.array([[563.5, 751.5], [1691.5, 751.5]]))
    middle = np.tan(angle_between(west, east) / 2.0)
    tangents = np.tan(np.radians(sighting.field_deg) / 2.0)
    assert tangents == pytest.approx([2.0 * middle, 2.0 * middle * 1504 / 2256])


@pytest.mark.parametrize(("field_deg", "side_deg"), [((3.0, 2.0), (3.0, 2.0)), ((60.0, 40.0), (20.0, 20.0))])
def test_the_points_of_a_field_stand_in_for_stars_all_over_it(field_deg, side_deg):
    """Their spread is that of the field: a fifth off each border, and of a wide one only the middle."""
    width, height = 2000.0 * np.tan(np.radians(field_deg) / 2.0)
    pinhole = Camera.centred(round(1000 * width), round(1000 * height), 1e6)
    points = Sighting.of(solution(pinhole, np.eye(3)), WHEN).sky
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.ones(25))
    plane = points[:, :2] / points[:, 2:]
    assert plane.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
    edge = np.tan(np.radians(side_deg) / 2.0)
    assert plane.max(axis=0) == pytest.approx(0.8 * edge, rel=1e-4)
    assert len(np.unique(plane.round(12), axis=0)) == 25
    steps = np.diff(np.unique((plane / edge).round(5)))
    assert steps == pytest.approx(np.full(4, 0.4), rel=1e-4)
