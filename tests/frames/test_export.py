"""What is written of a solution can be read back."""

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from kochab.core.attitude import attitude_from, radec_deg, wrapped
from kochab.core.camera import Camera
from kochab.core.frame import Frame
from kochab.core.solution import NamedStar, Solution
from kochab.frames.export import annotate, annotated_picture, compass, ds9_regions, stars_csv
from kochab.frames.sky_grid import grid_lines
from tests.frames.files import sky


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
def test_regions_and_pictures_name_greek_letters_in_ascii(name, ascii_name):
    answer = solution()
    answer, plain = (replace(answer, stars=(replace(answer.stars[-1], name=text),)) for text in (name, ascii_name))
    assert ds9_regions(answer) == ds9_regions(plain)
    assert f"text={{{ascii_name}}}" in ds9_regions(answer)
    assert name in stars_csv(answer)
    frame = Frame(np.zeros((480, 640), np.uint16))
    pictures = [np.asarray(annotated_picture(frame, shown)) for shown in (answer, plain)]
    assert np.array_equal(*pictures)


def test_what_cannot_be_written_raises(tmp_path):
    with pytest.raises(OSError, match="No such file"):
        annotate(Frame(sky(480, 640)), solution(), tmp_path / "absent" / "a.png")


def test_a_name_near_the_right_edge_stands_left_of_its_star():
    answer = solution()
    star = replace(answer.stars[-1], x=600.0, y=200.0, name="Alpha Lyrae the bright")
    frame = Frame(np.zeros((480, 640), np.uint16))
    named = annotated_picture(frame, replace(answer, stars=(star,)))
    ink = np.asarray(named)[150:250, :, 0] > 150  # the names are yellow, the circles green
    assert ink[:, 400:600].any()
    assert not ink[:, 606:].any()


@pytest.mark.parametrize("bayer", [None, "RGGB"])
def test_the_annotated_picture_marks_its_stars(tmp_path, bayer):
    frame = Frame(sky(480, 640), bayer=bayer)
    annotate(frame, solution(), tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        marked = np.asarray(picture.convert("RGB")).astype(int)
    scale = marked.shape[1] / 640
    green = (marked[..., 1] > marked[..., 0] + 60) & (marked[..., 1] > marked[..., 2] + 60)
    y, x = np.nonzero(green)
    for star in solution().stars:
        near = np.hypot(x - star.x * scale, y - star.y * scale) < 12
        assert np.hypot(x[near].mean() - star.x * scale, y[near].mean() - star.y * scale) < 1.5


def test_large_frames_are_thinned():
    picture = annotated_picture(Frame(np.zeros((2000, 5000), np.uint8)), solution(size=(5000, 2000)))
    assert max(picture.size) <= 2400


@pytest.mark.parametrize(("dec", "fov"), [(0.0, 1.0), (38.8, 10.0), (88.0, 60.0)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_annotated_picture_shows_round_right_ascensions_and_declinations(dec, fov, mirrored):
    answer = replace(solution(83.0, dec, 20.0, fov, mirrored), stars=())
    picture = np.asarray(annotated_picture(Frame(np.zeros((480, 640), np.uint16)), answer))
    y, x = np.nonzero((picture == (0x3F, 0x6F, 0xB5)).all(axis=-1))
    assert len(x) > 2000
    wanted = {kind: [] for kind in ("ra", "dec")}
    for line in grid_lines(answer, -0.5, -0.5, 639.5, 479.5):
        wanted[line.kind].append(line.value_deg)
    ras, decs = np.array([radec_deg(v) for v in answer.sky_at(np.column_stack([x, y]))]).T
    from_ra = np.abs(wrapped(ras[:, None] - wanted["ra"])).min(axis=1) * np.cos(np.radians(decs))
    from_dec = np.abs(decs[:, None] - wanted["dec"]).min(axis=1)
    pixel_deg = answer.camera.scale_arcsec_px / 3600.0
    assert np.minimum(from_ra, from_dec).max() < 2.0 * pixel_deg
    assert (from_ra < pixel_deg).any()
    assert (from_dec < pixel_deg).any()


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
