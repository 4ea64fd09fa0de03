"""Five stars are enough when all of them are bright stars, and chance does not get through."""

import numpy as np
import pytest

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.sky import open_catalogue
from kochab.solver.few_stars import identify_few

from .fields import YEAR, photograph


@pytest.mark.parametrize(
    ("ra", "dec", "fov_deg", "mirrored", "hinted"),
    [
        (84.0, 0.0, 15.0, False, False),
        (84.0, 0.0, 15.0, True, True),
        (278.5, 37.2, 12.0, True, False),
        (278.5, 37.2, 12.0, False, True),
    ],
)
def test_the_five_brightest_name_themselves(ra, dec, fov_deg, mirrored, hinted) -> None:
    focal = 600 / 2 / np.tan(np.radians(fov_deg / 2))
    camera = Camera.centred(600, 450, focal, mirrored)
    field = photograph(camera, attitude_from(ra, dec, 70.0), 5, 0.3)
    scale = camera.scale_arcsec_px
    hint = Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1)) if hinted else None
    found = identify_few(field.detections, hint, open_catalogue(), YEAR)
    assert found is not None
    assert found.camera.mirrored is mirrored
    assert (found.matches.star == field.rows[found.matches.detection]).all()
    assert found.log10_false_alarm < -5
    cosine = found.attitude.boresight @ field.attitude.boresight
    assert np.degrees(np.arccos(min(1.0, cosine))) < 0.1


def test_random_places_are_refused() -> None:
    rng = np.random.default_rng(8)
    for _ in range(20):
        xy = rng.uniform(0, 1, (rng.integers(5, 7), 2)) * [600, 450]
        hint = Hint(scale_arcsec_px=(70.0, 85.0))
        assert identify_few(Detections.from_list(xy, 600, 450), hint, open_catalogue(), YEAR) is None


@pytest.mark.parametrize("count", [0, 1, 4, 7])
def test_other_counts_are_not_its_business(count: int) -> None:
    xy = np.random.default_rng(0).uniform(0, 400, (count, 2))
    assert identify_few(Detections.from_list(xy, 600, 450), None, open_catalogue(), YEAR) is None


def test_a_field_too_narrow_for_the_bright_sky_is_left_alone() -> None:
    xy = np.random.default_rng(0).uniform(0, 400, (5, 2))
    hint = Hint(scale_arcsec_px=(1.0, 1.1))
    assert identify_few(Detections.from_list(xy, 600, 450), hint, open_catalogue(), YEAR) is None


def test_one_place_twice_is_no_crash() -> None:
    xy = np.full((5, 2), 100.0)
    assert identify_few(Detections.from_list(xy, 600, 450), None, open_catalogue(), YEAR) is None


def test_stars_that_crowd_where_the_detections_stand_make_it_less_certain(monkeypatch) -> None:
    camera = Camera.centred(600, 450, 600 / 2 / np.tan(np.radians(7.5)))
    field = photograph(camera, attitude_from(84.0, 0.0, 70.0), 5, 0.3)
    alarms, scale = [], camera.scale_arcsec_px
    hint = Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1))
    for crowd in (1.0, 3.0, 1e3):
        monkeypatch.setattr("kochab.identification.verification.crowding", lambda *_, crowd=crowd: crowd)
        found = identify_few(field.detections, hint, open_catalogue(), YEAR)
        alarms.append(found.log10_false_alarm if found else None)
    plain, dense, densest = alarms
    assert dense == pytest.approx(plain + 3 * np.log10(3.0))  # three stars confirm the two
    assert densest is None


# -- Exactly what is tried, and what that makes likely by chance -----------------------------------


class Asked:
    """The shipped catalogue, and which cones were asked of it."""

    def __init__(self):
        self.cones = []

    def brightest(self, vector, radius_rad, n, year):
        self.cones.append((vector, radius_rad, n, year))
        return open_catalogue().brightest(vector, radius_rad, n, year)

    def vectors(self, rows, year):
        return open_catalogue().vectors(rows, year)

    def mag(self, rows):
        return open_catalogue().mag(rows)


def five(count=5, seed=0):
    xy = np.random.default_rng(seed).uniform(0, 400, (count, 2))
    return Detections.from_list(xy, 600, 450)


def scale_arcsec_px(focal_px):
    return 206264.8 / focal_px


def cones(hint=None, count=5):
    catalogue = Asked()
    identify_few(five(count), hint, catalogue, YEAR)
    return catalogue.cones


def test_a_frame_of_unknown_scale_is_tried_from_seven_to_forty_five_degrees() -> None:
    """In steps of 21 % of the focal length at most; for each the whole sky's bright stars, 1.6 a detection a field."""
    low, high = (300.0 / np.tan(np.radians(width / 2.0)) for width in (45.0, 7.0))
    steps = int(np.ceil(np.log(high / low) / np.log(1.21)))
    ratio = (high / low) ** (1.0 / steps)
    middles = low * ratio ** (np.arange(steps) + 0.5)
    asked = cones()
    assert [radius for _, radius, _, _ in asked] == [np.pi] * steps
    expected = 1.6 * 5 * 4.0 * np.pi / (600 * 450 / middles**2)
    assert [n for _, _, n, _ in asked] == pytest.approx(expected, abs=1.0)
    assert {year for *_, year in asked} == {YEAR}


@pytest.mark.parametrize(("ratio", "windows"), [(1.0, 1), (1.2, 1), (1.22, 2), (1.4, 2), (1.48, 3)])
def test_a_hinted_scale_is_tried_in_steps_of_a_fifth(ratio, windows) -> None:
    scale = scale_arcsec_px(2000.0)
    for ends in ((scale, ratio * scale), (ratio * scale, scale)):
        asked = cones(Hint(scale_arcsec_px=ends))
        assert len(asked) == windows
        counts = np.array([n for _, _, n, _ in asked])
        edges = 2000.0 * ratio ** -np.linspace(1.0, 0.0, windows + 1)
        expected = 1.6 * 5 * 4.0 * np.pi / 270000.0 * edges[:-1] * edges[1:]
        assert counts == pytest.approx(expected, abs=1.0)


def test_no_more_than_twelve_thousand_stars_are_paired() -> None:
    for stars, tried in ((12000.5, True), (12001.5, False)):
        scale = scale_arcsec_px(np.sqrt(stars * 270000.0 / (1.6 * 5 * 4.0 * np.pi)))
        assert bool(cones(Hint(scale_arcsec_px=(scale, scale)))) is tried


def test_near_a_hinted_place_the_stars_come_from_a_cone_that_holds_the_frame() -> None:
    scale = scale_arcsec_px(2000.0)
    ((vector, radius, count, _),) = cones(Hint(scale_arcsec_px=(scale, scale), centre_deg=(90.0, 30.0, 6.0)))
    np.testing.assert_allclose(vector, [0.0, np.cos(np.radians(30.0)), 0.5], atol=1e-12)
    assert radius == pytest.approx(np.radians(6.0) + np.hypot(600, 450) / 2.0 / 2000.0)
    share = (1.0 - np.cos(radius)) / 2.0
    assert count == pytest.approx(1.6 * 5 * 4.0 * np.pi / 270000.0 * 2000.0**2 * share, abs=1.0)
    ((_, radius, _, _),) = cones(Hint(scale_arcsec_px=(scale, scale), centre_deg=(90.0, 30.0, 180.0)))
    assert radius == np.pi


def test_six_stars_are_tried_when_triangles_were_not() -> None:
    """Triangles need the scale to a quarter; without them six stars are worth their pairs."""
    scale = scale_arcsec_px(2000.0)
    for hint, tried in (
        (None, True),
        (Hint(scale_arcsec_px=(scale, 1.26 * scale)), True),
        (Hint(scale_arcsec_px=(scale, 1.24 * scale)), False),
        (Hint(centre_deg=(84.0, 0.0, 3.0)), True),
    ):
        assert bool(cones(hint, 6)) is tried


CAMERA = Camera.centred(600, 450, 600 / 2 / np.tan(np.radians(7.5)))
SCALE = CAMERA.scale_arcsec_px


def orion(mirrored=False):
    camera = Camera.centred(600, 450, CAMERA.focal_px, mirrored)
    return photograph(camera, attitude_from(84.0, 0.0, 70.0), 5, 0.0).detections


@pytest.mark.parametrize("ends", [(0.85, 1.002), (0.998, 1.15)])
def test_a_scale_at_the_end_of_what_is_hinted_is_found(ends) -> None:
    found = identify_few(orion(), Hint(scale_arcsec_px=(ends[0] * SCALE, ends[1] * SCALE)), open_catalogue(), YEAR)
    assert found is not None
    assert found.camera.focal_px == pytest.approx(CAMERA.focal_px, rel=1e-3)
    for away in (1.03, 0.97):
        near = Hint(scale_arcsec_px=(away * SCALE * 0.99, away * SCALE * 1.01))
        assert identify_few(orion(), near, open_catalogue(), YEAR) is None


def base_of(xy):
    """The two that are farthest apart, and the others."""
    gap = np.linalg.norm(xy[:, None] - xy, axis=2)
    pair = np.unravel_index(np.argmax(gap), gap.shape)
    return list(pair), [k for k in range(len(xy)) if k not in pair]


@pytest.mark.parametrize(("off_px", "found"), [(5.1, True), (5.7, False)])
def test_a_witness_stands_within_a_hundredth_of_the_frames_width(monkeypatch, off_px, found) -> None:
    """0.9 % of 600 px are 5.4 px, in any direction."""
    monkeypatch.setattr("kochab.solver.few_stars.ACCEPT_LOG10", 9.0)  # however likely by chance
    plain = orion()
    _, others = base_of(plain.xy)
    for direction in ((1.0, 0.0), (0.0, -1.0), (-0.6, 0.8)):
        xy = plain.xy.copy()
        xy[others[0]] += off_px * np.array(direction)
        hint = Hint(scale_arcsec_px=(0.999 * SCALE, 1.001 * SCALE), centre_deg=(84.0, 0.0, 1.0))
        answer = identify_few(Detections.from_list(xy, 600, 450), hint, open_catalogue(), YEAR)
        assert (answer is not None) is found


def test_the_bound_counts_every_pair_and_the_farthest_witness(monkeypatch) -> None:
    """Ordered pairs as far apart as the base may be, of both parities, times three circles of the worst distance."""
    monkeypatch.setattr("kochab.identification.verification.crowding", lambda *_: 1.0)
    monkeypatch.setattr("kochab.solver.few_stars.ACCEPT_LOG10", 9.0)
    plain = orion()
    base, others = base_of(plain.xy)
    xy = plain.xy.copy()
    xy[others[1]] += [0.0, 3.0]
    catalogue = Asked()
    hint = Hint(scale_arcsec_px=(0.95 * SCALE, 1.05 * SCALE), centre_deg=(84.0, 0.0, 20.0))
    found = identify_few(Detections.from_list(xy, 600, 450), hint, catalogue, YEAR)
    ((vector, radius, count, _),) = catalogue.cones
    stars = open_catalogue().vectors(open_catalogue().brightest(vector, radius, count, YEAR), YEAR)
    rays = [Camera.centred(600, 450, CAMERA.focal_px / scale).unproject(xy[base]) for scale in (1.05, 0.95)]
    widest, narrowest = (float(a @ b) for a, b in rays)
    cosines = (stars @ stars.T)[np.triu_indices(len(stars), 1)]
    unordered = np.count_nonzero((cosines >= widest) & (cosines <= narrowest))
    assert found.candidates == pytest.approx(4 * unordered, abs=8)
    assert found.matches.detection.tolist() == sorted(found.matches.detection)
    density = 1.6 * 5 / (600 * 450)
    chance = density * np.pi * 3.0**2
    assert found.log10_false_alarm == pytest.approx(np.log10(found.candidates) + 3.0 * np.log10(chance), abs=0.15)


def test_the_crowd_is_counted_about_the_middle_of_the_frame(monkeypatch) -> None:
    """Of the three that bear witness, among all stars where they should be."""
    asked = []
    monkeypatch.setattr("kochab.identification.verification.crowding", lambda *told: asked.append(told) or 1.0)
    detections = orion()
    hint = Hint(scale_arcsec_px=(0.99 * SCALE, 1.01 * SCALE), centre_deg=(84.0, 0.0, 1.0))
    assert identify_few(detections, hint, open_catalogue(), YEAR)
    _, others = base_of(detections.xy)
    ((seen, stars, half, density),) = asked
    np.testing.assert_allclose(seen, detections.xy[others] - [300.0, 225.0])
    assert np.linalg.norm(seen[:, None] - stars, axis=2).min(axis=1).max() < 1.0
    assert len(stars) > 5
    assert (half.tolist(), density) == ([300.0, 225.0], pytest.approx(1.6 * 5 / (600 * 450)))


class Neighbours:
    """Five stars where a frame shows them, and a brighter one beside one of the witnesses."""

    def __init__(self, xy, apart_px):
        _, others = base_of(xy)
        places = np.concatenate([[xy[others[0]] + [apart_px, 0.0]], xy])
        self.places = CAMERA.unproject(places) @ attitude_from(84.0, 0.0, 70.0).matrix

    def brightest(self, *_):
        return np.arange(6)

    def vectors(self, rows, _year):
        return self.places[rows]


@pytest.mark.parametrize(("apart_px", "fainter"), [(1.8, False), (2.2, True), (3.8, True)])
def test_a_star_two_pixels_from_a_brighter_one_has_no_place_of_its_own(apart_px, fainter) -> None:
    xy = orion().xy
    _, others = base_of(xy)
    hint = Hint(scale_arcsec_px=(0.99 * SCALE, 1.01 * SCALE))
    found = identify_few(Detections.from_list(xy, 600, 450), hint, Neighbours(xy, apart_px), YEAR)
    assert found is not None
    rows = dict(zip(found.matches.detection.tolist(), found.matches.star.tolist(), strict=True))
    assert rows[others[0]] == (others[0] + 1 if fainter else 0)
    assert all(rows[k] == k + 1 for k in range(5) if k != others[0])
