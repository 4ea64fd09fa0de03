"""The lines of a grid have the values that they claim, also against astropy's horizon."""

from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.frames.sky_grid import DEC_STEPS_DEG, RA_STEPS_DEG, GridLine, grid_lines
from kochab.sky.horizon import STANDARD_REFRACTION as AIR
from kochab.sky.horizon import Horizon


def solution_at(ra, dec, roll=0.0, fov=12.0):
    camera = Camera.centred(600, 400, 300.0 / np.tan(np.radians(fov) / 2.0), False)
    return Solution(camera, attitude_from(ra, dec, roll), (), 0.2, -30.0, "test")


@settings(max_examples=40)
@given(st.floats(0, 360), st.floats(-90, 90), st.floats(-180, 180), st.sampled_from([0.8, 5, 40, 90]))
def test_every_point_of_a_line_has_the_lines_value(ra, dec, roll, fov):
    solution = solution_at(ra, dec, roll, fov)
    lines = grid_lines(solution, -0.5, -0.5, 599.5, 399.5)
    assert {line.kind for line in lines} == {"ra", "dec"}
    assert len(lines) < 60
    for line in lines:
        on = line.xy[np.isfinite(line.xy).all(axis=1)]
        sky = [radec_deg(v) for v in solution.sky_at(on)]
        values = np.array([p[0] if line.kind == "ra" else p[1] for p in sky])
        away = (values - line.value_deg + 180.0) % 360.0 - 180.0
        # Near the pole a meridian's points differ in RA by next to nothing on the sky.
        shrink = np.cos(np.radians([p[1] for p in sky])) if line.kind == "ra" else 1.0
        assert np.abs(away * shrink).max() < 1e-6


def test_a_field_across_zero_hours_has_lines_on_both_sides():
    values = [x.value_deg for x in grid_lines(solution_at(0.0, 10.0), 0, 0, 599, 399) if x.kind == "ra"]
    assert any(v > 350 for v in values)
    assert any(v < 10 for v in values)


@pytest.mark.parametrize("dec", [90.0, -90.0, 88.0])
def test_the_pole_has_meridians_all_round(dec):
    ra = sorted(x.value_deg for x in grid_lines(solution_at(10.0, dec), 0, 0, 599, 399) if x.kind == "ra")
    assert len(ra) >= 6
    assert np.diff([*ra, ra[0] + 360]).max() < 70


def test_a_view_beside_the_frame_has_no_lines():
    assert grid_lines(solution_at(84, 0), 700, 500, 900, 800) == []


def test_zooming_in_makes_finer_lines():
    solution = solution_at(84.0, -1.0)
    wide = grid_lines(solution, 0, 0, 599, 399)
    near = grid_lines(solution, 290, 190, 310, 205)
    assert min(x.step_deg for x in near) < min(x.step_deg for x in wide) / 5


WHEN = datetime(2025, 1, 15, 21, 30, tzinfo=UTC)
PLACES = {"Munich": Site(48.14, 11.58, 520.0), "Paranal": Site(-24.63, -70.40, 2635.0), "Quito": Site(-0.2, -78.5)}


@pytest.mark.parametrize(
    ("place", "alt", "az", "fov"),
    [  # each place and each field in each direction once
        (("Munich", "Paranal", "Quito")[(i + k) % 3], *direction, fov)
        for i, direction in enumerate([(45.0, 200.0), (12.0, 0.0), (89.0, 90.0), (60.0, 359.9)])
        for k, fov in enumerate([0.8, 12.0, 70.0])
    ],
)
def test_lines_of_altitude_and_azimuth_are_astropys(place, alt, az, fov):
    """Above 11 degrees, below which ERFA holds no longer; UT1 - UTC, 45 ms that day, turns all the sky by 0.7 arcsec, polar motion by 0.5."""
    import astropy.units as u
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord
    from astropy.time import Time

    site = PLACES[place]
    horizon = Horizon(site, WHEN)
    a, h = np.radians([az, alt])
    (centre,) = horizon.catalogue(np.array([[np.cos(h) * np.sin(a), np.cos(h) * np.cos(a), np.sin(h)]]))
    solution = solution_at(*radec_deg(centre), roll=33.0, fov=fov)
    lines = grid_lines(solution, -0.5, -0.5, 599.5, 399.5, horizon)
    assert {line.kind for line in lines} == {"az", "alt"}
    assert 3 < len(lines) < 60
    frame = AltAz(
        obstime=Time(WHEN.replace(tzinfo=None)),
        location=EarthLocation(site.longitude_deg * u.deg, site.latitude_deg * u.deg, site.height_m * u.m),
        pressure=AIR.pressure_at(site) * u.hPa,
        temperature=AIR.temperature_c * u.deg_C,
        relative_humidity=AIR.humidity,
        obswl=AIR.wavelength_um * u.micron,
    )
    seen = 0
    for line in lines:
        on = line.xy[np.isfinite(line.xy).all(axis=1)]
        ra, dec = np.array([radec_deg(v) for v in solution.sky_at(on)]).T
        there = SkyCoord(ra * u.deg, dec * u.deg).transform_to(frame)
        value = there.az.deg if line.kind == "az" else there.alt.deg
        away = (value - line.value_deg + 180.0) % 360.0 - 180.0
        shrink = np.cos(there.alt.rad) if line.kind == "az" else 1.0
        high = there.alt.deg > 11.0
        assert np.abs(away * shrink)[high].max(initial=0.0) * 3600.0 < 2.0
        seen += int(high.sum())
    assert seen > 100


def test_the_text_of_a_line_says_which_grid_it_belongs_to():
    solution = solution_at(83.0, 20.0)
    texts = {line.text for line in grid_lines(solution, 0, 0, 599, 399, Horizon(PLACES["Munich"], WHEN))}
    assert {text.split()[0] for text in texts} == {"az", "alt"}
    assert any(text.startswith("alt +5") for text in texts)
    assert all(text.endswith("°") for text in texts)


@pytest.mark.parametrize(
    ("steps_deg", "turn_deg", "per_turn_s"), [(RA_STEPS_DEG, 360.0, 86400), (DEC_STEPS_DEG, 180.0, 648000)]
)
def test_the_steps_of_a_grid_are_whole_seconds_and_part_the_turn(steps_deg, turn_deg, per_turn_s):
    """Lines at 23h 45m and 0h 05m would be as far apart as no others; a step of 33° ends in no whole turn."""
    assert list(steps_deg) == sorted(steps_deg, reverse=True)
    for step in steps_deg:
        assert turn_deg / step == pytest.approx(round(turn_deg / step), abs=1e-9)
        assert step / turn_deg * per_turn_s == pytest.approx(round(step / turn_deg * per_turn_s), abs=1e-6)
    ratios = [coarse / fine for coarse, fine in pairwise(steps_deg)]
    assert max(ratios) <= 3.01, "zooming in steps over no scale"


def test_the_equator_has_no_sign():
    assert [GridLine("dec", value, 5.0, np.zeros((2, 2))).text for value in (0.0, -1e-9, 5.0, -5.0)] == [
        "0°",
        "0°",
        "+5°",
        "−5°",
    ]
