"""Dec that moves while the bolts are turned is told; bolts and a slipping RA are not taken for it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.polar.live import LivePhase
from kochab.polar.measure import PolarFindingKind
from tests.polar.mounts import ARCSEC, Mount
from tests.polar.test_live import adjusted, sky_turn, start


def moved_in_declination(attitude, mount, arcmin):
    """The camera turned about the line across boresight and polar axis: nothing else can do that."""
    across = np.cross(attitude.boresight, mount.axis)
    across *= arcmin * 60.0 * ARCSEC / np.linalg.norm(across)
    return replace(attitude, matrix=Rotation.from_rotvec(across).as_matrix() @ attitude.matrix)


def kinds(seen):
    return {finding.kind for finding in seen.findings}


@pytest.mark.parametrize("latitude", [-35.0, 48.0, 70.0])
@pytest.mark.parametrize("hour", [-150.0, -60.0])
@pytest.mark.parametrize("arcmin", [5.0, -15.0, 90.0])
@pytest.mark.parametrize("tracking", [True, False])
def test_a_declination_axis_that_moves_is_told_with_its_size(latitude, hour, arcmin, tracking):
    mount = Mount(latitude, 1800.0, -2700.0, hour_deg=hour)
    rng = np.random.default_rng(3)
    live = LivePhase(start(mount, rng))
    theta = [sky_turn(mount, s) * tracking for s in (5.0, 10.0, 400.0)]
    for seconds, turn in zip((5.0, 10.0), theta, strict=False):
        seen = live.update(adjusted(mount, 1800.0, -2700.0, 90, turn, seconds, rng))
        assert PolarFindingKind.DEC_MOVED not in kinds(seen)
    late = adjusted(mount, 1800.0, -2700.0, 90, theta[2], 400.0, rng)
    seen = live.update(moved_in_declination(late, mount, arcmin))
    assert PolarFindingKind.DEC_MOVED in kinds(seen)
    assert PolarFindingKind.SLIPPING not in kinds(seen)
    said = next(f.text for f in seen.findings if f.kind is PolarFindingKind.DEC_MOVED)
    size, unit = re.search(r"moved by ([0-9.]+)([′°])", said).groups()
    assert float(size) * {"′": 1.0, "°": 60.0}[unit] == pytest.approx(abs(arcmin), abs=0.3)
    again = adjusted(mount, 1800.0, -2700.0, 90, theta[2], 402.0, rng)
    assert PolarFindingKind.DEC_MOVED in kinds(live.update(moved_in_declination(again, mount, arcmin)))


def test_bolts_and_slips_of_ra_are_never_taken_for_it():
    for seed in range(40):
        rng = np.random.default_rng([5, seed])
        mount = Mount(
            rng.uniform(-60, 70),
            *rng.normal(0.0, 2000.0, 2),
            rho_deg=rng.uniform(15, 100),
            hour_deg=rng.uniform(-180, 180),
        )
        live = LivePhase(start(mount, rng))
        seconds, slip, bolts = 0.0, 0.0, [mount.d_alt, mount.d_az]
        tracking = bool(rng.integers(2))
        for _ in range(10):
            seconds += rng.uniform(2, 20)
            bolts[rng.integers(2)] += rng.normal(0.0, 600.0)
            slip += rng.normal(0.0, 0.02) * (rng.uniform() < 0.1)
            theta = sky_turn(mount, seconds) * tracking + slip
            seen = live.update(adjusted(mount, *bolts, 90, theta, seconds, rng))
            assert PolarFindingKind.DEC_MOVED not in kinds(seen)


def test_on_the_meridian_it_passes_for_the_altitude_bolt():
    """There the two turn the camera about one line: what cannot be told is not guessed."""
    mount = Mount(48.0, 1800.0, 0.0, hour_deg=-90.0)
    live = LivePhase(start(mount))
    still = adjusted(mount, 1800.0, 0.0, 90, sky_turn(mount, 5.0), 5.0)
    assert abs(still.boresight[0]) < 0.01
    live.update(still)
    seen = live.update(moved_in_declination(still, mount, 15.0))
    assert PolarFindingKind.DEC_MOVED not in kinds(seen)
    assert abs(abs(seen.error.altitude_arcsec - 1800.0) - 900.0) < 30.0
