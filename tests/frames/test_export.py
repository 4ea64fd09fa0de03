"""What is written of a solution can be read back."""

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.solution import NamedStar, Solution
from kochab.frames.export import compass, ds9_regions, stars_csv


def solution(ra=279.2, dec=38.8, roll=20.0, fov_deg=10.0, mirrored=False, size=(640, 480)):
    focal = size[0] / 2 / np.tan(np.radians(fov_deg) / 2)
    camera = Camera.centred(*size, focal, mirrored)
    attitude = attitude_from(ra, dec, roll)
    stars = []
    for x, y, name, mag in ((100, 80, "Vega, the {bright}", 0.03), (400.5, 300.25, "", 4.0)):
        ray = camera.unproject(np.array([[x, y]]))[0] @ attitude.matrix
        stars.append(NamedStar(x, y, "HIP 91262", name, mag, *radec_deg(ray), 0.1))
    return Solution(camera, attitude, tuple(reversed(stars)), 0.2, -30.0, "test")


def test_csv_reads_back():
    answer = solution()
    rows = list(csv.DictReader(io.StringIO(stars_csv(answer))))
    assert [r["name"] for r in rows] == ["Vega, the {bright}", ""]  # brightest first
    assert float(rows[1]["x"]) == 400.5
    assert float(rows[1]["ra_deg"]) == pytest.approx(answer.stars[0].ra_deg, abs=1e-6)


def test_regions_mark_every_star():
    answer = solution()
    text = ds9_regions(answer)
    circles = re.findall(r'^circle\(([\d.]+),([-\d.]+),([\d.]+)"\) # text=\{([^{}]*)\}$', text, re.M)
    assert len(circles) == 2
    assert float(circles[0][0]) == pytest.approx(answer.stars[0].ra_deg, abs=1e-6)
    assert circles[0][3] == "HIP 91262"


@pytest.mark.parametrize(
    ("name", "ascii_name"),
    [("θ¹ Ori C", "theta1 Ori C"), ("λ Ori", "lambda Ori"), ("ψ¹⁰ Aur", "psi10 Aur"), ("Bélénos", "Belenos")],
)
def test_regions_name_greek_letters_in_ascii(name, ascii_name):
    answer = solution()
    answer, plain = (replace(answer, stars=(replace(answer.stars[-1], name=text),)) for text in (name, ascii_name))
    assert ds9_regions(answer) == ds9_regions(plain)
    assert f"text={{{ascii_name}}}" in ds9_regions(answer)
    assert name in stars_csv(answer)


@given(st.floats(0, 360), st.floats(-89, 89), st.floats(-180, 180), st.booleans())
def test_compass(ra, dec, roll, mirrored):
    answer = solution(ra, dec, roll, 5.0, mirrored)
    north, east = compass(answer)
    turned = north[0] * east[1] - north[1] * east[0]
    assert turned == pytest.approx(1.0 if mirrored else -1.0, abs=1e-3)
    # roll is the position angle of the screen's up, east of north
    up = np.array([0.0, -1.0])
    angle = np.degrees(np.arctan2(up @ east, up @ north))
    assert (angle - answer.roll_deg + 180) % 360 - 180 == pytest.approx(0.0, abs=0.2)


def test_compass_at_the_pole_points_somewhere():
    for dec in (90.0, -90.0):
        assert np.isfinite(compass(solution(0.0, dec, 10.0))).all()
