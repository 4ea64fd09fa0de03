"""The default method where the scale is known: few stars are enough, and chance is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution
from kochab.identification.index import shipped
from kochab.identification.patterns import MOST_FOR_TRIANGLES, Patterns, Search, known_camera
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue
from tests.identification.conftest import of_shipped

SIDE = 1024


def knowing(scale: float, share: float) -> Hint:
    return Hint(scale_arcsec_px=(scale / (1.0 + share), scale * (1.0 + share)))


def hint_for(fov_deg: float, share: float) -> Hint:
    return knowing(Camera.centred(SIDE, SIDE, focal_px(fov_deg)).scale_arcsec_px, share)


def focal_px(fov_deg: float) -> float:
    return SIDE / 2.0 / float(np.tan(np.radians(fov_deg / 2.0)))


@pytest.mark.parametrize(
    ("stars", "share", "fov_deg", "least"),
    [
        (4, 1e-3, 15.0, 7),
        (5, 1e-3, 8.0, 9),
        (6, 0.01, 15.0, 10),
        (8, 0.03, 30.0, 10),
        (8, 0.1, 15.0, 9),
        (20, 0.01, 10.0, 11),
    ],
)
def test_few_stars_are_enough(stars, share, fov_deg, least) -> None:
    rng, catalogue = np.random.default_rng(3), open_catalogue()
    plan = FieldPlan(fov_deg, SIDE, noise_px=0.2, missing=0.0, spurious=0.0, magnitude_scatter=0.1, brightest=stars)
    right = 0
    for _ in range(12):
        field = random_field(catalogue, rng, plan)
        hint = knowing(field.camera.scale_arcsec_px, share)
        found = run(Patterns().identify(field.detections, hint, 2016.0))
        if isinstance(found, NoSolution):
            continue
        right += 1
        assert found.log10_false_alarm <= -5.0
        assert found.camera.mirrored == field.camera.mirrored
        assert found.camera.focal_px == pytest.approx(field.camera.focal_px, rel=0.01)
        off = np.linalg.norm(found.attitude.boresight - field.attitude.boresight)
        assert off * field.camera.focal_px < 4.0
        seen = field.camera.project(found.matches.vectors @ field.attitude.matrix.T)
        assert np.abs(seen - found.matches.xy).max() < 4.0
        np.testing.assert_array_equal(found.matches.xy, field.detections.xy[found.matches.detection])
        true = catalogue.vectors(found.matches.star, 2016.0)
        np.testing.assert_allclose(found.matches.vectors, true, atol=1e-9)
    assert right >= least


@given(st.floats(0, 360), st.floats(-89, 89), st.floats(-180, 180), st.booleans())
@settings(max_examples=25)
def test_any_pointing_roll_and_parity(toy_sky, toy_volume, ra, dec, roll, mirrored) -> None:
    attitude = attitude_from(ra, dec, roll)
    camera = Camera.centred(SIDE, SIDE, focal_px(20.0), mirrored)
    xy = camera.project(toy_sky @ attitude.matrix.T)
    with np.errstate(invalid="ignore"):
        inside = np.nonzero(((xy > 0) & (xy < SIDE)).all(axis=1))[0][:12]
    listed = Detections.from_list(xy[inside], SIDE, SIDE)
    found = run(Patterns((toy_volume,)).identify(listed, hint_for(20.0, 0.01)))
    assert isinstance(found, Identification)
    assert found.camera.mirrored == mirrored
    assert np.degrees(np.linalg.norm(found.attitude.boresight - attitude.boresight)) < 0.05
    assert (found.matches.star - 100 == inside[found.matches.detection]).all()


@given(st.integers(0, 10**6), st.integers(3, MOST_FOR_TRIANGLES), st.sampled_from([1e-4, 0.01, 0.03]))
@settings(max_examples=40)
def test_points_that_are_no_stars_are_refused(seed, count, share) -> None:
    points = random_points(np.random.default_rng(seed), count, SIDE)
    search = Search(points, hint_for(15.0, share))
    for known in known_camera(search, of_shipped):
        assert next(known.verdicts(), None) is None


def test_chance_reaches_a_bound_no_oftener_than_it_says() -> None:
    rng, least = np.random.default_rng(4), []
    for _ in range(150):
        points = random_points(rng, int(rng.integers(4, 9)), SIDE)
        searches = known_camera(Search(points, hint_for(20.0, 1e-3)), of_shipped)
        for known in searches:
            assert next(known.verdicts(), None) is None
        least.append(min(known.least for known in searches))
    assert (np.array(least) < -1.0).mean() < 0.1
    assert (np.array(least) < -2.0).mean() <= 0.02  # 1.5 are expected at most, 4 come once in fifteen


def test_a_third_star_beside_another_is_no_evidence() -> None:
    """Two pairs of close stars look alike everywhere: the second of a pair says nothing new."""
    xy = np.array([[100.0, 200.0], [800.0, 700.0], [802.0, 703.0], [101.0, 204.0], [798.0, 700.0]])
    search = Search(Detections.from_list(xy, SIDE, SIDE), hint_for(15.0, 0.01))
    for known in known_camera(search, of_shipped):
        gap = [0.01] * 5
        assert known._alarm(gap, 0, 1, 5.0)[0] == 0.0


@pytest.mark.parametrize(
    ("stars", "fov_deg", "hint"),
    [
        (6, 15.0, None),
        (6, 15.0, Hint()),
        (2, 15.0, hint_for(15.0, 0.01)),
        (12, 15.0, hint_for(15.0, 0.1)),
        (6, 15.0, hint_for(15.0, 0.2)),
        (MOST_FOR_TRIANGLES + 1, 15.0, hint_for(15.0, 0.01)),
        (6, 1.0, hint_for(1.0, 0.01)),
    ],
)
def test_other_cases_are_left_to_the_quads(stars, fov_deg, hint) -> None:
    points = random_points(np.random.default_rng(1), stars, SIDE)
    assert known_camera(Search(points, hint), of_shipped) == ()


def test_the_hint_s_place_is_kept_to() -> None:
    rng, catalogue = np.random.default_rng(5), open_catalogue()
    field = random_field(catalogue, rng, FieldPlan(15.0, SIDE, missing=0.0, spurious=0.0, brightest=12))
    scale = knowing(field.camera.scale_arcsec_px, 0.01).scale_arcsec_px
    ra, dec = field.attitude.ra_dec_deg
    here, there = (ra, dec, 5.0), ((ra + 180.0) % 360.0, -dec, 5.0)
    for centre, answered in ((here, True), (there, False)):
        hint = Hint(scale_arcsec_px=scale, centre_deg=centre)
        found = run(Patterns().identify(field.detections, hint))
        assert isinstance(found, Identification) is answered


@pytest.mark.parametrize("xy", [np.ones((5, 2)), np.stack([np.arange(6.0)] * 2, axis=1) * 150])
def test_stars_in_one_place_or_on_a_line_are_no_answer(xy) -> None:
    listed = Detections.from_list(xy, SIDE, SIDE)
    assert isinstance(run(Patterns().identify(listed, hint_for(15.0, 0.01))), NoSolution)


def test_stars_that_crowd_where_the_detections_stand_make_it_less_certain(monkeypatch) -> None:
    plan = FieldPlan(15.0, SIDE, 0.2, 0.0, 0.0, magnitude_scatter=0.1, brightest=6)
    field = random_field(open_catalogue(), np.random.default_rng(3), plan)
    hint, alarms = knowing(field.camera.scale_arcsec_px, 1e-3), []
    for crowd in (1.0, 3.0, 1e5):
        monkeypatch.setattr("kochab.identification.verification.crowding", lambda *_, crowd=crowd: crowd)
        found = run(Patterns(shipped(), ()).identify(field.detections, hint, 2016.0))
        alarms.append(getattr(found, "log10_false_alarm", None))
    plain, dense, densest = alarms
    assert plain + np.log10(3.0) < dense < plain + 4.1 * np.log10(3.0)  # four confirm the two
    assert densest is None
