"""The mounts of the alignment bench point where they are turned to."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.lab.bench.polar_sweeps import Mount, _pointed


@pytest.mark.parametrize("seed", range(5))
def test_a_mount_that_stands_anyhow_is_turned_to_a_star(seed) -> None:
    """A base that leans by degrees, a camera that looks beside the tube, a star 10 deg from where it points."""
    rng = np.random.default_rng(seed)
    mount = Mount(
        (Rotation.from_euler("x", -40.0, degrees=True) * Rotation.from_rotvec(rng.normal(0.0, 0.05, 3))).as_matrix(),
        Rotation.from_rotvec(rng.normal(0.0, 0.03, 3)).as_matrix(),
    )
    ra, dec = rng.uniform(-2.0, 2.0), rng.uniform(-0.3, 0.9)
    star = mount.attitude(ra + rng.uniform(-0.15, 0.15), dec + rng.uniform(-0.15, 0.15))[:, 2]
    turned = _pointed(mount, ra, dec, star)
    np.testing.assert_allclose(mount.attitude(*turned)[:, 2], star, atol=1e-9)
    assert np.hypot(turned[0] - ra, turned[1] - dec) < 0.3
