"""Dec backlash from frames and the mount's position in their headers, against the gears of the practice rig."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.mount import Direction
from kochab.simulate.mechanics.axis import GearErrors
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.tracking import Place, tracking_of

GUIDE_ARCSEC_S = 0.5 * 15.041


def dithered(seed, backlash_arcsec, frames=90, dither_arcsec=20.0, noise_arcsec=0.5):
    """A night of 30 s frames dithered by pulses after every second; headers round to an arcsecond."""
    rng = np.random.default_rng([seed, 36])
    gear = GearErrors(backlash_deg=backlash_arcsec / 3600.0)
    mount = MountConfig(dec_gear=gear, misalignment_arcmin=(4.0, 3.0), guide_rate=0.5)
    rig = PracticeRig(RigConfig(seed=seed, mount=mount, start_deg=(rng.uniform(-50.0, 40.0), rng.uniform(5.0, 60.0))))
    places = []
    for k in range(frames):
        rig.clock.sleep(15.0)
        truth = rig.truth()
        ra, dec = np.add(truth.ra_dec_deg, rng.normal(0.0, noise_arcsec / 3600.0, 2))
        believed = tuple(np.round(3600.0 * np.array(rig.mount.believed_deg())) / 3600.0)
        places.append(Place(truth.time_utc, ra, dec, 2.0, exposure_s=30.0, reported_deg=believed))
        rig.clock.sleep(15.0)
        for ways in ((Direction.NORTH, Direction.SOUTH), (Direction.EAST, Direction.WEST)) if k % 2 else ():
            far = rng.uniform(-dither_arcsec, dither_arcsec)
            rig.mount.pulse(ways[int(far < 0.0)], 1000.0 * abs(far) / GUIDE_ARCSEC_S)
            rig.clock.sleep(abs(far) / GUIDE_ARCSEC_S + 0.2)
    return places


def test_backlash_is_the_gears() -> None:
    """Sixteen nights of 90 and 150 frames, gears with 0 to 40 arcsec of play, scatter 0.3 to 1 arcsec."""
    pulls = []
    for seed in range(16):
        true = (0.0, 5.0, 10.0, 20.0, 40.0)[seed % 5]
        (held,) = tracking_of(
            dithered(seed, true, (90, 150)[seed % 2], (20.0, 40.0)[seed % 3 > 0], (0.3, 1.0)[seed % 2])
        )
        if isinstance(held.backlash_arcsec, Measure):
            pulls.append((held.backlash_arcsec.value - true) / held.backlash_arcsec.sigma)
    assert len(pulls) >= 9
    assert np.mean(np.abs(pulls) < 2.0) >= 0.9
    assert np.abs(pulls).max() < 3.0


def still(reported):
    """Frames of a field that drifts in RA; ``reported`` gives (RA, Dec) of the header from those of the sky."""
    rng = np.random.default_rng(1)
    start = datetime(2026, 3, 1, 22, tzinfo=UTC)
    places = []
    for k in range(90):
        ra, dec = 80.0 + 1e-4 * k, 20.0 + 5.0 / 3600.0 * rng.normal()
        places.append(Place(start + timedelta(seconds=40 * k), ra, dec, 2.0, reported_deg=reported(ra, dec, rng)))
    return places


@pytest.mark.parametrize(
    ("reported", "why"),
    [
        (lambda ra, dec, rng: None, "do not say where the mount was"),
        (lambda ra, dec, rng: (80.1, 20.05), "never turned back"),
        (lambda ra, dec, rng: (ra, dec + 1e-5 * rng.normal()), "repeat the solution"),
        (lambda ra, dec, rng: (80.1, 20.05 + 5.0 / 3600.0 * rng.normal()), "do not follow"),
    ],
)
def test_without_the_motors_own_word_it_is_unknown(reported, why) -> None:
    (held,) = tracking_of(still(reported))
    assert isinstance(held.backlash_arcsec, str)
    assert why in held.backlash_arcsec
