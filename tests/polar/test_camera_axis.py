"""What one sweep leaves to the next after the bolts were turned: where the camera sees the axis."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kochab.polar.camera_axis import camera_axis_of, with_axis_seen_before
from kochab.polar.error import CHI2_68, CHI2_95
from kochab.polar.live import LivePhase
from kochab.polar.measure import MeasureSettings, measure_local
from kochab.polar.pole import Pole
from kochab.sky.horizon import Refraction
from tests.polar.mounts import ARCSEC, Mount

SETTINGS = MeasureSettings(Mount(48.0).site, Pole.TRUE, Refraction(pressure_hpa=0.0))
BEFORE, AFTER = Mount(48.0, 1500.0, -2000.0), Mount(48.0, 30.0, 20.0, hour_deg=-15.0)  # the bolts were turned between
TURNS = (0.0, 17.0, 34.0)


def frames(mount, rng, after=None):
    return mount.see(TURNS, rng, after)


def measured(mount, rng, after=None):
    return measure_local(frames(mount, rng, after), SETTINGS)


def axis_of_both_by_scipy(first, second):
    """The later axis (3,) of two sweeps whose frames share its place in the camera: one least squares over all."""

    def unit(angles):
        azimuth, altitude = angles
        return np.array([np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)])

    def residuals(unknowns):
        place, turns, found = unit(unknowns[:2]), unknowns[6:], []
        for number, sweep in enumerate((first, second)):
            axis = unit(unknowns[2 + 2 * number : 4 + 2 * number])
            across = np.cross(place, axis)
            angle = np.arctan2(np.linalg.norm(across), place @ axis)
            base = Rotation.from_rotvec(across / np.linalg.norm(across) * angle)
            for frame, turn in zip(sweep, turns[3 * number :], strict=False):
                model = Rotation.from_rotvec(axis * turn) * base
                gap = (Rotation.from_matrix(frame.matrix).inv() * model).as_rotvec()
                found.append(gap / np.sqrt(np.diag(frame.covariance)))
        return np.concatenate(found)

    axes = [measure_local(sweep, SETTINGS) for sweep in (first, second)]
    place = axes[1].fit.reference.T @ axes[1].error.axis
    start = [v for d in (place, *(one.error.axis for one in axes)) for v in (np.arctan2(d[0], d[1]), np.arcsin(d[2]))]
    for sweep, one in zip((first, second), axes, strict=True):
        axis = one.error.axis
        across = np.cross(place, axis)
        angle = np.arctan2(np.linalg.norm(across), place @ axis)
        base = Rotation.from_rotvec(across / np.linalg.norm(across) * angle).as_matrix()
        start += [float(Rotation.from_matrix(frame.matrix @ base.T).as_rotvec() @ axis) for frame in sweep]
    return unit(least_squares(residuals, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x[4:6])


@pytest.mark.parametrize("seed", range(5))
def test_two_sweeps_are_one_least_squares_in_which_the_place_in_the_camera_is_shared(seed):
    rng = np.random.default_rng([3, seed])
    first, second = frames(BEFORE, rng), frames(AFTER, rng)
    earlier, alone = (measure_local(sweep, SETTINGS) for sweep in (first, second))
    both = with_axis_seen_before(alone, camera_axis_of(earlier))
    truth = axis_of_both_by_scipy(first, second)
    by_itself = np.linalg.norm(alone.error.axis - truth) / ARCSEC
    assert np.linalg.norm(both.error.axis - truth) / ARCSEC == pytest.approx(0.0, abs=0.02 + 0.01 * by_itself)


def test_a_sweep_that_follows_another_is_nearer_and_as_sure_as_it_says():
    rng, found = np.random.default_rng(5), []
    for _ in range(250):
        known = camera_axis_of(measured(BEFORE, rng))
        alone = measured(AFTER, rng)
        both = with_axis_seen_before(alone, known)
        found.append(
            [
                *(np.linalg.norm(each.error.axis - AFTER.axis) / ARCSEC for each in (alone, both)),
                *(each.error.uncertainty_arcsec for each in (alone, both)),
                both.error.distance2(AFTER.axis),
            ]
        )
    off_alone, off_both, said_alone, said_both, distance2 = np.array(found).T
    assert np.sqrt(np.mean(off_both**2) / np.mean(off_alone**2)) == pytest.approx(0.8, abs=0.12)
    assert np.sqrt(np.mean(said_both**2) / np.mean(said_alone**2)) < 0.9
    assert np.mean(distance2 < CHI2_68) == pytest.approx(0.70, abs=0.1)
    assert np.mean(distance2 < CHI2_95) > 0.92


def test_the_live_phase_goes_on_with_the_axis_of_both():
    rng = np.random.default_rng(8)
    both = with_axis_seen_before(measured(AFTER, rng), camera_axis_of(measured(BEFORE, rng)))
    live = LivePhase(both)
    seen = live.update(both.last_of_fit)
    assert np.linalg.norm(seen.error.axis - both.error.axis) / ARCSEC < both.error.uncertainty_arcsec
    assert live.camera_axis.covariance == pytest.approx(both.fit.camera_covariance)


@pytest.mark.parametrize(
    ("what", "turn"), [("declination", [1.0, 0.0, 0.0]), ("the camera in its holder", [0.0, 0.0, 1.0])]
)
def test_what_was_moved_between_two_sweeps_parts_them(what, turn):
    """Ten arcminutes: the later sweep stands alone, to the digit."""
    rng = np.random.default_rng(9)
    known = camera_axis_of(measured(BEFORE, rng))
    moved = Rotation.from_rotvec(np.array(turn) * 600.0 * ARCSEC).as_matrix()
    alone = measured(AFTER, rng, after=(0, moved))
    assert with_axis_seen_before(alone, known) is alone, what


def test_nothing_is_left_to_a_first_sweep():
    rng = np.random.default_rng(10)
    alone = measured(AFTER, rng)
    assert with_axis_seen_before(alone, None) is alone
