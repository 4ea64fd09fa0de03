import numpy as np
import pytest

from kochab.core.attitude import Attitude, attitude_from, rotation_vector, small_rotation
from kochab.lab.estimators import average

ARCSEC = np.radians(1 / 3600)
SIGMA = 15.0 * ARCSEC


def noisy(matrix, rng):
    turn = small_rotation(rng.normal(0, SIGMA, 3))
    return Attitude(turn @ matrix, np.eye(3) * SIGMA**2)


@pytest.mark.parametrize("count", [1, 4, 64])
def test_pointing_noise_falls_with_the_root_of_the_number(count) -> None:
    rng, truth = np.random.default_rng(1), attitude_from(10.0, 70.0, 30.0).matrix
    off = []
    for _ in range(200):
        mean = average(noisy(truth, rng) for _ in range(count))
        off.append(rotation_vector(truth @ mean.matrix.T))
        assert mean.sigma_arcsec[0] == pytest.approx(15.0 / np.sqrt(count))
    assert np.std(off) / ARCSEC == pytest.approx(15.0 / np.sqrt(count), rel=0.1)


def test_what_cannot_be_averaged_is_said() -> None:
    with pytest.raises(ValueError, match="nothing"):
        average([])
    with pytest.raises(ValueError, match="covariance"):
        average([attitude_from(1.0, 2.0, 3.0)])
