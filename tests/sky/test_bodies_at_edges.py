"""Which bodies a frame shows, and which detection is one: made-up bodies at chosen pixels."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.attitude import attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.sky import frame_bodies, small_bodies
from kochab.sky.frame_bodies import body_mark
from kochab.sky.solar_system import Body, BodyKind

WHEN = datetime(2026, 3, 14, 21, 0, tzinfo=UTC)
W, H, SCALE, RMS_PX = 1000, 800, 10.0, 0.1
"""10 arcsec a pixel: a disc of 40 arcsec has a radius of 2 px."""
SOLUTION = Solution(
    Camera.centred(W, H, np.degrees(1.0) * 3600.0 / SCALE), attitude_from(80.0, 20.0, 30.0), (), RMS_PX, -50.0, ""
)


def body_at(x, y, kind=BodyKind.PLANET, sigma_arcsec=0.0, diameter_arcsec=0.0, magnitude=1.0, name="Mars"):
    ra, dec = radec_deg(SOLUTION.sky_at(np.array([[x, y]]))[0])
    return Body(name, kind, ra, dec, 1.0, magnitude, diameter_arcsec, 1.0, sigma_arcsec)


@pytest.fixture
def show(monkeypatch):
    """What the frame shows when these bodies are near it and these places (N, 2), px, were detected."""

    def show(*bodies, detected=()):
        def near(*words):
            return bodies
            yield

        monkeypatch.setattr(small_bodies, "bodies_near", near)
        detections = Detections.from_list(np.array(detected, dtype=float).reshape(-1, 2), W, H)
        return run(frame_bodies.bodies_in_frame(SOLUTION, detections, WHEN, None, None)).bodies

    return show


@pytest.mark.parametrize(
    ("outwards", "edge"),
    [((-1, 0), (0.0, 400.0)), ((1, 0), (W - 1.0, 400.0)), ((0, -1), (500.0, 0.0)), ((0, 1), (500.0, H - 1.0))],
)
def test_a_body_is_in_the_frame_while_its_disc_is(show, outwards, edge):
    for away_px, seen in ((1.9, True), (2.1, False)):
        x, y = np.array(edge) + away_px * np.array(outwards)
        assert bool(show(body_at(x, y, diameter_arcsec=40.0))) is seen
    for away_px, seen in ((-0.1, True), (0.1, False)):
        x, y = np.array(edge) + away_px * np.array(outwards)
        assert bool(show(body_at(x, y))) is seen


@pytest.mark.parametrize(("sigma_arcsec", "diameter_arcsec"), [(0.0, 0.0), (0.0, 60.0), (80.0, 0.0), (20.0, 40.0)])
def test_a_detection_within_three_sigma_of_a_discs_edge_is_the_body(show, sigma_arcsec, diameter_arcsec):
    """The sigma is of the fit with half a pixel of centroid, and of the body's own place."""
    own_px = np.hypot(RMS_PX + 0.5, sigma_arcsec / SCALE)
    reach_px = diameter_arcsec / 2.0 / SCALE + 3.0 * own_px
    there = body_at(500.0, 400.0, sigma_arcsec=sigma_arcsec, diameter_arcsec=diameter_arcsec)
    for away_px, seen in ((0.98 * reach_px, True), (1.02 * reach_px, False)):
        for turn in np.radians([0.0, 135.0, 270.0]):
            place = (500.0 + away_px * np.cos(turn), 400.0 + away_px * np.sin(turn))
            (found,) = show(there, detected=[place])
            assert found.seen is seen


@pytest.mark.parametrize(
    ("kind", "sigma_arcsec", "seen"),
    [(BodyKind.PLANET, 99.0, True), (BodyKind.PLANET, 101.0, False), (BodyKind.MOON, 900.0, True)],
)
def test_only_the_moon_is_seen_where_a_body_is_known_no_better_than_by_a_hundred_arcseconds(
    show, kind, sigma_arcsec, seen
):
    (found,) = show(body_at(500.0, 400.0, kind, sigma_arcsec), detected=[(500.0, 400.0)])
    assert found.seen is seen


def test_one_detection_is_one_body_the_brightest(show):
    near = [body_at(500.0, 400.0, name="Saturn"), body_at(500.5, 400.0, magnitude=8.0, name="Titan")]
    assert [one.seen for one in show(*near, detected=[(500.2, 400.0)])] == [True, False]
    assert [one.seen for one in show(*near, detected=[(500.2, 400.0), (502.25, 400.0)])] == [True, True]


def trail(*pixels):
    """A satellite over these pixels, one after another."""
    places = [tuple(map(float, radec_deg(SOLUTION.sky_at(np.array([one]))[0]))) for one in pixels]
    return replace(body_at(*pixels[0], kind=BodyKind.SPACECRAFT, name="ISS"), trail=tuple(places))


def test_a_satellite_stands_at_the_middle_of_its_trail_within_the_frame(show):
    """It enters at the left and leaves at the right edge, 60 px at a step, from 540 px beside the frame on."""
    path = [(-540.0 + 60.0 * k, 100.0 + 20.0 * k) for k in range(31)]
    (found,) = show(trail(*path))
    inside = [(x, y) for x, y in path if -0.5 <= x <= W - 0.5]
    assert (found.x, found.y) == pytest.approx(inside[len(inside) // 2], abs=1e-6)
    kept = SOLUTION.pixels_of(
        np.array([replace(found.body, ra_deg=ra, dec_deg=dec).vector for ra, dec in found.body.trail])
    )
    np.testing.assert_allclose(kept, inside, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_trail_goes_to_the_outer_edges_of_the_outermost_pixels(show, axis):
    last = (W, H)[axis] - 0.5
    along = [-0.75, -0.25, 300.0, last - 0.25, last + 0.25]
    path = [(at, 200.0) if axis == 0 else (200.0, at) for at in along]
    (found,) = show(trail(*path))
    assert len(found.body.trail) == 3
    assert (found.x, found.y)[axis] == pytest.approx(300.0)


def test_of_a_long_trail_seventeen_points_are_kept_both_ends_among_them(show):
    path = [(float(x), 300.0) for x in range(0, 1000, 3)]
    (found,) = show(trail(*path))
    assert len(found.body.trail) == 17
    ends = SOLUTION.pixels_of(
        np.array(
            [
                replace(found.body, ra_deg=ra, dec_deg=dec).vector
                for ra, dec in found.body.trail[:: len(found.body.trail) - 1]
            ]
        )
    )
    np.testing.assert_allclose(ends, [path[0], path[-1]], atol=1e-6)


def test_a_satellite_that_passes_beside_the_frame_is_not_in_it(show):
    assert show(trail((-30.0, 100.0), (-20.0, 300.0), (-10.0, 500.0))) == ()


def test_a_body_is_drawn_as_its_disc_and_a_satellite_as_its_trail():
    disc = body_mark(SOLUTION, body_at(500.0, 400.0, diameter_arcsec=80.0), 3, np.array([500.0, 400.0]))
    assert (disc.radius, disc.row) == (pytest.approx(4.0), 3)
    np.testing.assert_allclose(np.hypot(*(disc.shapes[0] - [500.0, 400.0]).T), 4.0)
    np.testing.assert_allclose(disc.shapes[0][0], disc.shapes[0][-1])
    path = [(500.0 + 10.0 * k, 400.0) for k in range(-2, 4)]
    drawn = body_mark(SOLUTION, trail(*path), 0, np.array([500.0, 400.0]))
    np.testing.assert_allclose(drawn.shapes[0], path, atol=1e-6)
    assert drawn.radius == pytest.approx(30.0)


def test_a_body_of_unknown_brightness_comes_after_those_that_are_known():
    ranks = [
        body_mark(SOLUTION, body_at(500.0, 400.0, magnitude=magnitude), 0, np.array([500.0, 400.0])).mag
        for magnitude in (-4.0, 1.0, 19.0, float("nan"), 21.0)
    ]
    assert ranks == sorted(ranks)
