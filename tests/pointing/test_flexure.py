"""The droop of a tube on mounts made from axes and rotations with ERFA: the rig's is in `tests/workflows`."""

import numpy as np
import pytest

from kochab.pointing.flexure import tube_droop
from kochab.pointing.pointing_model import fit_model
from tests.pointing.faulty_mounts import sightings
from tests.pointing.test_pointing_model import bad_mount


@pytest.mark.parametrize(("noise_arcmin", "least", "most"), [(0.03, 0.0, 30.0), (2.0, 30.0, 120.0)])
def test_a_mount_that_takes_refraction_out_has_no_droop(noise_arcmin, least, most) -> None:
    """Refraction is a hundred arcsec of droop; both answers are tried. What scatters tells neither."""
    pulls, sigmas = [], []
    for seed in range(12):
        mount, rng = bad_mount(seed)
        mount.noise = noise_arcmin
        seen = sightings(mount, 12, rng, sides=True)
        value, sigma = tube_droop(seen, fit_model(seen))
        pulls.append(value / sigma)
        sigmas.append(sigma)
    assert np.abs(pulls).max() < 3.0
    assert np.sqrt(np.mean(np.square(pulls))) < 1.5
    assert least < np.median(sigmas) < most


def test_four_places_have_no_droop() -> None:
    mount, rng = bad_mount(1)
    seen = sightings(mount, 5, rng, sides=True)
    model = fit_model(seen)
    assert tube_droop(seen[:4], model) is None
    assert tube_droop(seen, model) is not None
