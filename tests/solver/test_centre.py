"""What is printed of an attitude belongs to the frame's centre, as astropy.wcs sees it; the optical axis apart."""

import json
import warnings

import numpy as np
import pytest

from kochab.core.attitude import apart_deg, attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.frames import read_frame
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame
from kochab.workflows.solution_json import as_json, to_line

REAL = ("gran__cisne_02sec.jpg", "cedar__orion_trees.jpg", "anet__apod4.jpg", "pan__solved.fits")


def sky_axes(solution):
    """Right, down and out at the middle of the frame, (3, 3) ICRS, by astropy's steps of a pixel."""
    camera = solution.camera
    x, y = (camera.width - 1) / 2, (camera.height - 1) / 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        places = solution.wcs.all_pix2world([x, x, x], [y, y - 0.5, y + 0.5], 0)
    out, above, below = unit_vectors(*places)
    down = below - above
    down /= np.linalg.norm(down)
    return np.stack([np.cross(down, out), down, out])


def check(solution):
    out = json.loads(to_line(as_json("a", solution)))
    dcm, axis = np.array(out["dcm"]), out["optical_axis"]
    # SIP follows the camera model to 0.005 px and its slope hardly worse: 0.06 arcsec on 46 real frames
    assert np.degrees(np.abs(dcm - sky_axes(solution)).max()) * 3600.0 < 1.0
    centre = unit_vectors(out["ra_deg"], out["dec_deg"])
    np.testing.assert_allclose(dcm[2], centre, atol=1e-12)
    np.testing.assert_allclose(dcm, attitude_from(out["ra_deg"], out["dec_deg"], out["roll_deg"]).matrix, atol=1e-12)
    assert out["euler_deg"] == [out["ra_deg"], out["dec_deg"], out["roll_deg"]]
    wcs = solution.wcs.wcs
    assert (axis["ra_deg"], axis["dec_deg"]) == pytest.approx(tuple(wcs.crval), abs=1e-9)
    assert (axis["x_px"] + 1, axis["y_px"] + 1) == pytest.approx(tuple(wcs.crpix))
    # the axis and the camera put every star where the line says
    matrix = attitude_from(axis["ra_deg"], axis["dec_deg"], axis["roll_deg"]).matrix
    for star in out["stars"][:20]:
        place = solution.camera.project(unit_vectors(star["ra_deg"], star["dec_deg"])[None] @ matrix.T)[0]
        assert np.hypot(place[0] - star["x"], place[1] - star["y"]) == pytest.approx(star["residual_px"], abs=1e-4)
    return apart_deg((out["ra_deg"], out["dec_deg"]), (axis["ra_deg"], axis["dec_deg"]))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("lens", [{}, {"k1": -0.2, "k2": 0.05, "p1": 1e-3}])
def test_an_axis_off_the_middle_moves_neither_centre_nor_roll(mirrored, lens):
    camera = Camera(1200, 800, 1500.0, 640.0, 420.0, mirrored=mirrored, **lens)
    solution = Solution(camera, attitude_from(210.0, 54.0, 33.0), (), 0.3, -30.0, "test")
    assert check(solution) > 1.0


@pytest.mark.parametrize("name", REAL)
def test_a_real_frames_rotation_is_its_centres(shared_frames, name):
    solution = run(solve_frame(read_frame(shared_frames / name), SolveOptions(timeout_s=None)))
    assert isinstance(solution, Solution)
    check(solution)
