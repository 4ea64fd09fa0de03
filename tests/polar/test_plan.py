"""Predicted uncertainties: POLAR's table, and agreement with what the fit finds."""

import numpy as np
import pytest

from kochab.core.attitude import angle_between
from kochab.polar.axis_fit import fit_axis
from kochab.polar.plan import Optics, more_turn_deg, turn_needed_deg, weighted_arcsec
from tests.polar.mounts import ARCSEC, Mount
from tests.polar.plane import axis_of_plane, plane_of_three_arcsec, two_attitudes_arcsec

USUAL = Optics(2.0, 20.0)


@pytest.mark.parametrize(
    ("turn", "plane", "near", "far", "three", "seven"),
    [(20, 158, 18, 71, 64, 58), (30, 71, 12, 49, 36, 27), (60, 19, 6.2, 25, 14, 12.5), (90, 8.6, 4.5, 17, 7.8, 5.4)],
)
def test_the_table_of_expected_errors(turn, plane, near, far, three, seven):
    assert plane_of_three_arcsec(2.0, turn) == pytest.approx(plane, rel=0.04)
    assert two_attitudes_arcsec(USUAL, 10.0, turn) == pytest.approx(near, rel=0.04)
    assert two_attitudes_arcsec(USUAL, 60.0, turn) == pytest.approx(far, rel=0.04)
    # these two were found by trial over few runs, so they scatter more
    assert weighted_arcsec(USUAL, 60.0, turn, 3) == pytest.approx(three, rel=0.12)
    assert weighted_arcsec(USUAL, 60.0, turn, 7) == pytest.approx(seven, rel=0.2)


def test_the_fit_of_two_is_the_closed_form():
    for rho in (0.5, 10.0, 60.0, 90.0):
        assert weighted_arcsec(USUAL, rho, 40.0, 2) == pytest.approx(two_attitudes_arcsec(USUAL, rho, 40.0), rel=1e-4)


def test_predictions_are_what_happens():
    rng = np.random.default_rng(2)
    mount = Mount(45.0, 900.0, 400.0)
    turns = [0, 20, 40, 60]
    plane, fitted = [], []
    for _ in range(300):
        seen = mount.see(turns, rng)
        fitted.append(angle_between(fit_axis(seen, mount.pole).axis, mount.axis))
        axis = axis_of_plane(np.stack([seen[k].boresight for k in (0, 1, 3)]))
        plane.append(angle_between(axis * np.sign(axis @ mount.axis), mount.axis))
    rms = np.sqrt(np.mean(np.square(fitted))) / ARCSEC
    assert rms == pytest.approx(weighted_arcsec(USUAL, 60.0, 60.0, 4), rel=0.12)
    assert np.sqrt(np.mean(np.square(plane))) > fitted[0]


def test_more_turn_is_asked_for_until_it_is_enough():
    need = turn_needed_deg(USUAL, 60.0, 30.0)
    assert need == 40.0
    assert weighted_arcsec(USUAL, 60.0, 35.0, 3) > 30.0
    assert turn_needed_deg(USUAL, 60.0, 0.5) is None
    assert more_turn_deg(USUAL, 60.0, np.radians([0, 10, 20]), 30.0) == 20.0
    assert more_turn_deg(USUAL, 60.0, np.radians([0, 45, 90]), 30.0) == 0.0
    assert more_turn_deg(USUAL, 60.0, np.radians([0, 45, 90]), 0.1) is None
    assert more_turn_deg(USUAL, 60.0, np.zeros(1), 30.0) == pytest.approx(50.0, abs=5.0)
