"""What is no star field, or not one alone, is refused or found as what it is."""

import numpy as np
import pytest

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections

SIDE, YEAR = 1024, 2016.0


def sky(ra, dec, roll, fov_deg, count=90):
    """The brightest stars of a field, (N, 2) px from the middle, and their flux."""
    camera = Camera.centred(SIDE, SIDE, SIDE / 2 / np.tan(np.radians(fov_deg) / 2))
    attitude = attitude_from(ra, dec, roll)
    catalogue = open_catalogue()
    rows = catalogue.brightest(attitude.boresight, np.radians(fov_deg), 4 * count, YEAR)
    xy = camera.project(catalogue.vectors(rows, YEAR) @ attitude.matrix.T) - SIDE / 2
    inside = np.flatnonzero((np.abs(xy) < SIDE / 2).all(axis=1))[:count]
    return xy[inside], 10 ** (-0.4 * catalogue.mag(rows[inside]))


def listed(xy, flux):
    inside = (np.abs(xy) < SIDE / 2).all(axis=1)
    order = np.argsort(-flux[inside], kind="stable")
    return Detections.from_list(xy[inside][order] + SIDE / 2, SIDE, SIDE, flux[inside][order])


def solved(detections, **options):
    return run(solve_detections(detections, SolveOptions(timeout_s=None, **options)))


def test_a_stretched_image_is_refused_with_how_much_it_is_stretched():
    """Square pixels agree with such a field along a line, turned by up to as much as the stretch: 3 deg."""
    xy, flux = sky(300.0, 40.0, 15.0, 23.0)
    along = np.radians(30.0)
    axis = np.array([np.cos(along), np.sin(along)])
    found = solved(listed(xy + 0.06 * (xy @ axis)[:, None] * axis, flux))
    assert isinstance(found, NoSolution)
    assert found.reason is Reason.DISTORTION_TOO_STRONG
    assert found.measured["stretch_share"] == pytest.approx(0.06, abs=0.003)
    assert "6.0 %" in found.advice


def test_a_lens_that_bends_is_not_taken_for_a_stretched_image():
    xy, flux = sky(300.0, 40.0, 15.0, 23.0)
    bent = xy * (1.0 + 0.03 * np.square(xy).sum(axis=1, keepdims=True) / (2 * (SIDE / 2) ** 2))
    assert isinstance(solved(listed(bent, flux)), Solution)


def test_a_star_that_proposed_is_no_witness_in_a_clump_of_detections():
    """Four proposers put their stars into four clumps, where each finds some other detection.

    The list is of arcs (``kochab bench identify``) and was a field of 6 deg to one in 10^5.2.
    """
    from kochab.lab.bench.identify_shapes import SHAPES, shape_list

    assert isinstance(solved(shape_list(SHAPES["arcs"], 20261208, 2)), NoSolution)


def test_two_fields_over_one_another_give_one_of_the_two():
    one, other = (sky(83.0, 0.0, 20.0, 12.0), sky(200.0, -45.0, -70.0, 12.0))
    found = solved(listed(np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1]])))
    assert isinstance(found, Solution)
    assert found.ra_dec_deg == pytest.approx((83.0, 0.0), abs=0.01) or found.ra_dec_deg == pytest.approx(
        (200.0, -45.0), abs=0.01
    )


def test_every_further_search_makes_chance_likelier():
    """A hint that leads nowhere was a search too: what the blind one says is shared by both."""
    detections = listed(*sky(83.0, 0.0, 20.0, 12.0, 14))
    blind = solved(detections)
    wrong = solved(detections, hint=Hint(scale_arcsec_px=(5.0, 6.0)))
    assert wrong.ra_dec_deg == pytest.approx(blind.ra_dec_deg)
    assert wrong.log10_false_alarm == pytest.approx(blind.log10_false_alarm + np.log10(2.0), abs=1e-6)
