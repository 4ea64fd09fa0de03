import json
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from kochab.core.attitude import apart_deg, attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame, Hint, Site
from kochab.core.progress import run
from kochab.core.solution import NamedStar, Solution
from kochab.sky import frame_bodies
from kochab.sky.frame_bodies import FrameBodies, bodies_in_frame, body_marks
from kochab.sky.solar_system import BodyKind

ROW = json.loads(Path(__file__).with_name("solar_system.json").read_text(encoding="utf-8"))["rows"][4]
WHEN, PLACE = datetime.fromisoformat(ROW["utc"]), Site(*ROW["site"])
RA, DEC = ROW["places"]["Jupiter"][:2]
"""Skyfield's."""


@pytest.fixture(scope="module")
def field(catalogue):
    """A frame of 4 degrees beside Jupiter as skyfield has it: its stars, Jupiter, and two things more."""
    camera = Camera.centred(1000, 800, 1000 / np.radians(4.0))
    solution = Solution(camera, attitude_from(RA + 0.3, DEC - 0.2, 30.0), (), 0.1, -50.0, "")
    rows = catalogue.cone(solution.centre_vector, np.radians(3.0), 10.0)
    xy = solution.pixels_of(catalogue.vectors(rows))
    inside = np.all((xy > 5) & (xy < [995, 795]), axis=1)
    rows, xy, mags = rows[inside], xy[inside], catalogue.mag(rows[inside])
    grid = np.stack(np.meshgrid(np.arange(60, 940, 20), np.arange(60, 740, 20)), axis=-1).reshape(-1, 2)
    empty = grid[np.argmax(np.linalg.norm(grid[:, None] - xy[None], axis=2).min(axis=1))]
    jupiter = solution.pixels_of(unit_vectors(RA, DEC)[None])[0]
    bright, faint = empty, empty + np.array([9.0, 0.0])
    flux = 10 ** (-0.4 * np.concatenate([mags, [-2.0, 5.0, 12.0]]))
    detections = Detections.from_list(np.vstack([xy, jupiter, bright, faint]), 1000, 800, flux)
    stars = tuple(NamedStar(x, y, "", "", float(m), 0.0, 0.0, 0.0) for (x, y), m in zip(xy.tolist(), mags, strict=True))
    assert len(stars) > 20
    return replace(solution, stars=stars), detections, bright


def test_the_sky_layer_gets_the_bodies_of_a_frame_that_says_when(field):
    frame = Frame(np.zeros((800, 1000), np.uint8), hint=Hint(time_utc=WHEN, site=PLACE))
    mark = next(mark for mark in run(body_marks(frame, field[0])) if mark.text == "Jupiter")
    assert np.hypot(*(mark.xy - field[0].pixels_of(unit_vectors(RA, DEC)[None])[0])) < 0.1
    assert np.ptp(mark.shapes[0][:, 0]) * field[0].camera.scale_arcsec_px == pytest.approx(
        mark.body.diameter_arcsec, 0.01
    )
    for hint in (Hint(), Hint(time_utc=WHEN, time_of_file=True)):
        assert run(body_marks(replace(frame, hint=hint), field[0])) == ()


def found(field, catalogue, when=WHEN):
    solution, detections, _ = field
    return run(bodies_in_frame(solution, detections, when, PLACE, catalogue))


def test_a_planet_is_named_at_its_detection(field, catalogue):
    told = found(field, catalogue)
    jupiter = next(b for b in told.bodies if b.body.name == "Jupiter")
    assert jupiter.seen
    assert jupiter.body.kind is BodyKind.PLANET
    assert (
        field[0].camera.scale_arcsec_px
        * np.hypot(*(np.array([jupiter.x, jupiter.y]) - field[0].pixels_of(unit_vectors(RA, DEC)[None])[0]))
        < 0.1
    )
    assert not any(b.body.name == "Saturn" for b in told.bodies)


def test_what_is_bright_and_in_no_catalogue_is_told_with_its_sigma(field, catalogue):
    (unknown,) = found(field, catalogue).unknown
    assert [unknown.x, unknown.y] == field[2].tolist()
    assert unknown.mag == pytest.approx(5.0, abs=0.01)
    assert apart_deg((unknown.ra_deg, unknown.dec_deg), (RA, DEC)) < 4.0
    assert unknown.sigma_arcsec == pytest.approx(field[0].rms_arcsec)


def test_a_planet_that_is_elsewhere_on_another_date_is_not_seen_and_its_detection_is_unknown(field, catalogue):
    told = found(field, catalogue, WHEN + timedelta(days=3))
    assert not any(b.seen for b in told.bodies if b.body.name == "Jupiter")
    assert {round(source.mag) for source in told.unknown} == {-2, 5}


def test_a_frame_without_a_date_is_looked_through_for_what_is_in_no_catalogue(field, catalogue):
    told = found(field, catalogue, None)
    assert told.bodies == ()
    assert {round(source.mag) for source in told.unknown} == {-2, 5}  # the planet, too


def test_of_a_thousand_detections_without_a_star_the_brightest_are_looked_up(field, catalogue, monkeypatch):
    solution, detections, _ = field
    few = replace(solution, stars=solution.stars[:12])
    asked, cone = [], type(catalogue).cone
    monkeypatch.setattr(type(catalogue), "cone", lambda *given: asked.append(1) or cone(*given))
    monkeypatch.setattr(frame_bodies, "BRIGHTEST", 3)
    assert {round(source.mag) for source in found((few, detections, None), catalogue, None).unknown} >= {-2}
    assert 1 <= len(asked) <= 3


def test_a_bright_star_that_the_fit_left_out_is_not_unknown(field, catalogue):
    solution, detections, _ = field
    brightest = min(solution.stars, key=lambda star: star.mag)
    without = replace(solution, stars=tuple(star for star in solution.stars if star is not brightest))
    assert found((without, detections, None), catalogue).unknown == found(field, catalogue).unknown


@pytest.mark.parametrize("compared", [1, 2000])
def test_stars_that_the_fit_left_out_are_found_at_once_and_the_same_as_one_by_one(
    field, catalogue, monkeypatch, compared
):
    """A cone for each of 100 took 20 to 30 ms."""
    solution, detections, _ = field
    kept = sorted(solution.stars, key=lambda star: star.mag)[-12:]
    cones = []
    cone = type(catalogue).cone
    monkeypatch.setattr(type(catalogue), "cone", lambda *words: cones.append(words) or cone(*words))
    monkeypatch.setattr(frame_bodies, "COMPARED", compared)
    unknown = found((replace(solution, stars=tuple(kept)), detections, None), catalogue, None).unknown
    assert {round(source.mag) for source in unknown} == {-2, 5}
    assert (len(cones) > 5) is (compared == 1)


@pytest.mark.parametrize("compared", [1, 2000])
@pytest.mark.parametrize(("brighter", "unknown"), [(2.6, False), (3.4, True)])
def test_a_source_three_magnitudes_brighter_than_the_star_there_is_unknown(
    field, catalogue, monkeypatch, compared, brighter, unknown
):
    """A smaller excess may be a variable, a double or a saturated star; both passes use the same limit."""
    solution, detections, _ = field
    # the one of eighth magnitude that stands farthest from the others
    away = {star: np.hypot(*(detections.xy - [star.x, star.y]).T) for star in solution.stars if 7.5 < star.mag < 8.6}
    star = max(away, key=lambda each: np.partition(away[each], 1)[1])
    here = int(np.argmin(away[star]))
    flux = detections.flux.copy()
    flux[here] = 10 ** (-0.4 * (star.mag - brighter))
    without = replace(solution, stars=tuple(each for each in solution.stars if each is not star))
    monkeypatch.setattr(frame_bodies, "COMPARED", compared)
    told = found((without, replace(detections, flux=flux), None), catalogue).unknown
    assert any(abs(source.x - star.x) < 1.0 and abs(source.y - star.y) < 1.0 for source in told) is unknown


@pytest.mark.parametrize(("away_px", "unknown"), [(14.5, False), (15.5, True)])
def test_a_source_is_a_stars_within_ten_residuals_three_widths_and_five_pixels(field, catalogue, away_px, unknown):
    """A residual of 0.1 px and a width that is not known, which counts as 3 px: 15 px."""
    solution, detections, _ = field
    star = min(solution.stars, key=lambda star: star.mag)
    here = int(np.argmin(np.hypot(*(detections.xy - [star.x, star.y]).T)))
    xy, flux = detections.xy.copy(), detections.flux.copy()
    xy[here, 0] += away_px
    flux[here] = 10 ** (-0.4 * star.mag)
    told = found((solution, replace(detections, xy=xy, flux=flux), None), catalogue).unknown
    assert any(source.x == xy[here, 0] for source in told) is unknown


def test_the_zero_point_is_the_magnitude_of_a_flux_of_one(field, catalogue):
    solution, detections, _ = field
    brighter = replace(detections, flux=detections.flux * 100.0)
    assert found((solution, brighter, None), catalogue).zero_point == pytest.approx((5.0, 0.0), abs=1e-9)
    three, two = (replace(solution, stars=solution.stars[:count]) for count in (3, 2))
    assert found((three, brighter, None), catalogue).zero_point[0] == pytest.approx(5.0)
    assert np.isnan(found((two, brighter, None), catalogue).zero_point).all()


def test_nothing_is_unknown_without_ten_stars_that_tell_the_zero_point(field, catalogue):
    solution, detections, _ = field
    nine, ten = (replace(solution, stars=solution.stars[:count]) for count in (9, 10))
    assert found((nine, detections, None), catalogue).unknown == ()
    assert found((ten, detections, None), catalogue).unknown


@pytest.mark.parametrize("exposure_s", [None, 30.0])
def test_a_frame_of_unknown_exposure_is_taken_for_a_moment(field, monkeypatch, exposure_s):
    asked = []

    def none(*words):
        asked.append(words)
        return FrameBodies((), ())
        yield

    monkeypatch.setattr(frame_bodies, "bodies_in_frame", none)
    frame = Frame(np.zeros((800, 1000), np.uint8), hint=Hint(time_utc=WHEN, site=PLACE, exposure_s=exposure_s))
    assert run(body_marks(frame, field[0])) == ()
    assert asked[0][-1] == (exposure_s or 0.0)


@pytest.mark.parametrize(("detected", "stars"), [(300, 100), (50, 50), (40, 0), (0, 3), (5, 5)])
def test_the_same_places_are_found_as_by_all_pairs(detected, stars) -> None:
    rng = np.random.default_rng(detected)
    # many share an x: a grid, as of a hot column
    xy = rng.integers(0, 12, (detected, 2)) + rng.choice([0.0, 0.25], (detected, 1))
    px = xy[rng.permutation(detected)[:stars]] if detected >= stars else rng.uniform(0, 9, (stars, 2))
    expected = np.nonzero((np.abs(xy[:, None] - px[None]) <= frame_bodies.SAME_PX).all(axis=2))
    found = frame_bodies._matched(xy, px)
    assert sorted(zip(*found, strict=True)) == sorted(zip(*expected, strict=True))
