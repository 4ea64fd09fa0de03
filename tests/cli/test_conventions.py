"""What the numbers of a JSON line mean, against astropy's own tangent plane.

From ``ra_deg``, ``dec_deg``, ``roll_deg``, ``mirrored`` and ``scale_arcsec_px`` alone a plain TAN
WCS is written down here by hand; the pixels it gives must be the pixels the line's stars were at.
"""

import json

import numpy as np
import pytest
from astropy.wcs import WCS
from scipy.spatial.transform import Rotation

from kochab.core.attitude import attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.solution import NamedStar, Solution
from kochab.workflows.solution_json import as_json, to_line

PIXELS = np.random.default_rng(4).uniform([0, 0], [799, 599], (30, 2))


def line(ra: float, dec: float, roll: float, mirrored: bool) -> dict:
    camera = Camera.centred(800, 600, 4000.0, mirrored)
    solution = Solution(camera, attitude_from(ra, dec, roll), (), 0.1, -20.0, "patterns")
    sky = solution.sky_at(PIXELS)
    stars = []
    for (x, y), v in zip(PIXELS.tolist(), sky, strict=True):
        star_ra = float(np.degrees(np.arctan2(v[1], v[0])) % 360)
        stars.append(NamedStar(x, y, "HIP 1", "", 5.0, star_ra, float(np.degrees(np.arcsin(v[2]))), 0))
    full = Solution(camera, solution.attitude, tuple(stars), 0.1, -20.0, "patterns")
    return json.loads(to_line(as_json("a.fits", full)))


CASES = [(10.0, 20.0, 0.0, False), (200.0, -70.0, 33.0, False), (359.9, 45.0, -150.0, True), (84.0, -5.0, 90.0, True)]


@pytest.mark.parametrize("case", CASES)
def test_centre_roll_parity_and_scale_are_a_plain_wcs(case) -> None:
    out = line(*case)
    wcs = WCS(naxis=2)
    wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    wcs.wcs.crval = [out["ra_deg"], out["dec_deg"]]
    wcs.wcs.crpix = [400.5, 300.5]  # FITS counts from 1: the middle of 800 x 600
    step, up = out["scale_arcsec_px"] / 3600, np.radians(out["roll_deg"])
    # On the screen (x right, y down) up is `roll` east of north; east is to the left of north
    # unless mirrored.
    to_left = -1.0 if out["mirrored"] else 1.0
    towards_up = np.array([np.sin(up), np.cos(up)])  # east, north
    towards_left = to_left * np.array([np.cos(up), -np.sin(up)])
    wcs.wcs.cd = step * np.column_stack([-towards_left, -towards_up])
    sky = np.array([(s["ra_deg"], s["dec_deg"]) for s in out["stars"]])
    np.testing.assert_allclose(wcs.all_world2pix(sky, 0), PIXELS, atol=1e-3)


@pytest.mark.parametrize("case", CASES)
def test_matrix_and_quaternion_take_icrs_to_camera_axes(case) -> None:
    out = line(*case)
    dcm = np.array(out["dcm"])
    np.testing.assert_allclose(dcm @ dcm.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(dcm) == pytest.approx(1.0)
    np.testing.assert_allclose(dcm[2], unit_vectors(out["ra_deg"], out["dec_deg"]), atol=1e-12)
    w, x, y, z = out["quaternion"]
    np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), dcm, atol=1e-12)
    assert w >= 0
    assert out["euler_deg"] == pytest.approx([out["ra_deg"], out["dec_deg"], out["roll_deg"]])
    star = out["stars"][0]
    right, down, ahead = dcm @ unit_vectors(star["ra_deg"], star["dec_deg"])
    sign = -1.0 if out["mirrored"] else 1.0
    focal = out["camera"]["focal_px"]
    assert out["camera"]["cx"] + sign * focal * right / ahead == pytest.approx(star["x"], abs=1e-6)
    assert out["camera"]["cy"] + focal * down / ahead == pytest.approx(star["y"], abs=1e-6)
