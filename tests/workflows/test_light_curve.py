"""Light curves: a variable rendered here from its definition, and the AAVSO's format."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.attitude import separation_deg
from kochab.core.errors import UsageError
from kochab.sky.apparent import JD_UNIX
from kochab.sky.catalogue import open_catalogue
from kochab.workflows.night import chosen_stars
from kochab.workflows.night.chosen_stars import ChosenStar, chosen_star, stars_in_frame
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.light_curve import aavso_extended, light_curves, observer_code
from kochab.workflows.night.sky_brightness import stars_on_sky
from tests.workflows.test_night_sky_brightness import AIRMASS, SIZE, ZERO_E, rendered

START = datetime(2026, 3, 1, 22, tzinfo=UTC)


def electrons(mag, colour=0.8, per_colour=-0.2):
    """Of a star, as `rendered` makes the others."""
    return ZERO_E * 10.0 ** (-0.4 * (mag + 0.2 * AIRMASS + per_colour * (colour - 0.8)))


@pytest.fixture(scope="module")
def night():
    """Fourteen frames with a star of B-V 0.3 that changes, where the catalogue has none; frames, true V."""
    frames, true = [], []
    _, _, solution = rendered(20)
    place = empty_place(solution)
    vector = solution.sky_at(np.array([place]))[0]
    star = ChosenStar("Test Star", vector, np.nan, 0.3)
    for k in range(14):
        mag = 9.6 + 0.35 * np.sin(k / 2.0)
        frame, found, solution = rendered(20 + k, vignette=0.0, extra=[(*place, electrons(mag, 0.3))])
        stars = stars_on_sky(frame, found, solution)
        seen = stars_in_frame(frame, solution, stars, [star])
        time = START + timedelta(minutes=3 * k)
        frames.append(NightFrame(f"{k}.fits", time, 30.0, (SIZE, SIZE), True, on_sky=stars, chosen=seen))
        true.append(mag)
    return frames, np.array(true)


def empty_place(solution):
    """The middle of the largest gap among the rendered stars, px."""
    xy = np.array([(star.x, star.y) for star in solution.stars])
    grid = np.array([(x, y) for x in range(100, 700, 7) for y in range(100, 700, 7)], dtype=float)
    alone = np.linalg.norm(grid[:, None] - xy, axis=2).min(axis=1)
    return tuple(grid[alone.argmax()].tolist())


def test_a_light_curve_holds_what_was_rendered(night):
    frames, true = night
    (curve,) = light_curves(frames)
    found = np.array([point.mag.value for point in curve.points])
    sigma = np.array([point.mag.sigma for point in curve.points])
    off = found - true
    assert np.abs(off.mean()) < 3.0 * curve.zero_mag + 0.01, "at its own colour, 0.5 bluer than most"
    pulls = (off - off.mean()) / sigma
    assert np.mean(np.abs(pulls) < 2.0) >= 0.9
    assert sigma.max() < 0.05
    assert 0.3 < np.ptp(found) / np.ptp(true) < 1.1


def test_the_check_star_is_one_of_the_catalogue_and_hardly_changes(night):
    (curve,) = light_curves(night[0])
    assert curve.check in night[0][0].on_sky.ids
    checks = np.array([point.check_mag for point in curve.points if point.check_mag is not None])
    assert len(checks) >= 12
    assert checks.std() < 0.03


def test_a_star_outside_or_saturated_is_left_out(night):
    frame, found, solution = rendered(20)
    stars = stars_on_sky(frame, found, solution)
    outside = ChosenStar("elsewhere", -solution.centre_vector, 9.0, 0.5)
    edge = ChosenStar("edge", solution.sky_at(np.array([[3.0, 400.0]]))[0], 9.0, 0.5)
    assert stars_in_frame(frame, solution, stars, [outside, edge]) == ()
    brightest = min(solution.stars, key=lambda star: star.mag)
    full = ChosenStar("full", solution.sky_at(np.array([[brightest.x, brightest.y]]))[0], 5.0, 0.5)
    clipped = replace(frame, saturation=float(frame.pixels.max()))
    assert stars_in_frame(clipped, solution, stars, [full]) == ()


def test_the_aavso_s_file_has_its_fields(night):
    """The Extended File Format of https://www.aavso.org/aavso-extended-file-format."""
    (curve,) = light_curves(night[0])
    head, rows = [], []
    for line in aavso_extended([curve], "ABC").splitlines():
        (head if line.startswith("#") else rows).append(line)
    stated = dict(line[1:].split("=", 1) for line in head if "=" in line)
    assert stated["TYPE"] == "EXTENDED"
    assert stated["OBSCODE"] == "ABC"
    assert stated["DATE"] == "JD"
    assert stated["DELIM"] == ","
    assert stated["OBSTYPE"] == "CCD"
    assert stated["SOFTWARE"].startswith("Kochab ")
    assert len(rows) == len(curve.points)
    for line, point in zip(rows, curve.points, strict=True):
        name, date, mag, merr, band, trans, kind, comp, cmag, _, kmag, air, group, chart, _ = line.split(",")
        assert (name, band, trans, kind, comp, cmag, group, chart) == (
            "TEST STAR", "CV", "NO", "STD", "ENSEMBLE", "na", "na", "na",
        )  # fmt: skip
        assert abs(float(date) - (point.time_utc.timestamp() / 86400.0 + JD_UNIX)) < 1e-5
        assert float(mag) == pytest.approx(point.mag.value, abs=6e-4)
        assert float(merr) > 0.0
        assert air == "na"
        assert kmag == "na" or abs(float(kmag) - point.check_mag) < 6e-4


def test_a_star_is_found_by_its_name_and_a_planet_is_none():
    star = chosen_star("RR Lyr")
    there = open_catalogue().brightest(star.vector, chosen_stars.SAME_RAD, 1)
    assert len(there) == 1
    assert separation_deg(star.vector, chosen_star("19h25m27.9s +42d47m04s").vector) < 20.0 / 3600.0
    for name in ("Jupiter", "M 13", "no such star"):
        with pytest.raises(UsageError):
            chosen_star(name)


@pytest.mark.parametrize("code", ["", "A", "ABCDEF", "A-B", "Ä1", "A\nB"])
def test_an_observer_s_code_is_letters_and_digits(code):
    with pytest.raises(UsageError):
        observer_code(code)


def test_an_observer_s_code_is_written_large():
    assert observer_code(" abc ") == "ABC"
