"""The model of a gyroscope on a pushed telescope, on turns that SciPy makes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.attitude import separation_deg
from kochab.pointing.gyro import GyroModel

RATE_HZ = 50.0


class Tube:
    """A tube on an altazimuth mount without a drive, with a gyroscope on it; time is its own."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.mounting = Rotation.random(random_state=seed)
        self.scale = 1.0 + self.random.normal(0.0, 0.01, 3)
        self.rest_deg_s = self.random.normal(0.0, 0.3, 3)
        self.model = GyroModel()
        self.now_s, self.az, self.alt = 10.0, 0.0, 45.0
        self.rest(2.0)

    @property
    def attitude(self) -> np.ndarray:
        """From Earth-fixed directions to camera axes; z is where it looks."""
        return Rotation.from_euler("ZYZ", (self.az, 90.0 - self.alt, 30.0), degrees=True).as_matrix().T

    def push(self, az: float, alt: float, seconds: float = 3.0) -> None:
        """By so many degrees, beginning and ending at rest."""
        start = self.az, self.alt
        moments, rates = [], []
        before = self.attitude
        for share in np.linspace(0.0, 1.0, round(seconds * RATE_HZ) + 1)[1:]:
            eased = 0.5 - 0.5 * np.cos(np.pi * share)
            self.az, self.alt = start[0] + eased * az, start[1] + eased * alt
            turn = -Rotation.from_matrix(self.attitude @ before.T).as_rotvec()
            before = self.attitude
            noise = self.random.normal(0.0, 0.007 * np.sqrt(RATE_HZ), 3)
            felt = self.mounting.inv().apply(np.degrees(turn) * RATE_HZ) * self.scale + self.rest_deg_s + noise
            self.now_s += 1.0 / RATE_HZ
            moments.append(self.now_s)
            rates.append(np.radians(felt))
        for k in range(0, len(moments), 5):
            self.model.feel(np.array(moments[k : k + 5]), np.array(rates[k : k + 5]))

    def rest(self, seconds: float) -> None:
        self.push(0.0, 0.0, seconds)

    def solve(self) -> float | None:
        self.rest(2.0)
        return self.model.see(self.attitude, self.now_s - 0.5)

    def off_deg(self) -> float:
        return separation_deg(self.model.attitude()[2], self.attitude[2])

    def learn(self) -> None:
        assert self.solve() is None
        for az, alt in ((15.0, 3.0), (-8.0, 18.0), (-20.0, -10.0)):
            self.push(az, alt)
            assert self.solve() is None


@pytest.mark.parametrize("seed", range(6))
def test_after_four_solves_it_leads_and_its_sigma_holds(seed) -> None:
    tube = Tube(seed)
    assert tube.model.attitude() is None
    tube.learn()
    assert tube.off_deg() < 1e-3
    for _ in range(5):
        tube.push(*tube.random.uniform((-25.0, -8.0), (25.0, 8.0)))
        sigma = tube.model.sigma_deg()
        assert tube.off_deg() < 3.0 * sigma
        assert sigma < 0.5
        tube.rest(20.0)
        assert tube.off_deg() < 3.0 * sigma  # at rest nothing is added up
        assert tube.solve() is None


def test_one_turn_does_not_tell_how_it_sits() -> None:
    """About the same axis it leads, about another it knows that it does not."""
    tube = Tube(1)
    tube.solve()
    tube.push(0.0, 20.0)
    tube.solve()
    tube.push(0.0, -15.0)
    assert tube.off_deg() < 3.0 * tube.model.sigma_deg() < 1.5
    tube.push(20.0, 0.0)
    assert tube.model.sigma_deg() > 2.0


def test_a_rate_at_rest_that_has_gone_far_is_found_by_two_solves_of_one_place() -> None:
    tube = Tube(2)
    tube.learn()
    tube.rest_deg_s = tube.rest_deg_s + 0.1
    tube.rest(3.0)
    assert tube.off_deg() > 0.1  # taken for a slow push
    tube.solve()
    tube.rest(5.0)
    tube.solve()
    tube.rest(10.0)
    assert tube.off_deg() < 0.02


def test_moved_on_the_tube_it_says_so_and_learns_anew() -> None:
    tube = Tube(3)
    tube.learn()
    tube.mounting = Rotation.from_euler("xyz", (30.0, 10.0, 0.0), degrees=True) * tube.mounting
    tube.push(20.0, 5.0)
    assert tube.solve() > 1.0
    tube.push(-10.0, -15.0)
    assert tube.solve() > 1.0
    tube.push(15.0, 3.0)
    assert tube.model.sigma_deg() > 2.0  # nothing is known of it any more
    tube.solve()
    tube.push(-8.0, 12.0)
    tube.solve()
    tube.push(15.0, -9.0)
    assert tube.off_deg() < 3.0 * tube.model.sigma_deg() < 2.0


def test_a_frame_that_moved_and_missing_rates_align_nothing() -> None:
    tube = Tube(4)
    tube.learn()
    tube.push(10.0, 0.0)
    assert tube.model.see(tube.attitude @ np.diag([1.0, -1.0, -1.0]), tube.now_s - 1.5) is None
    assert tube.off_deg() < 0.5
    tube.now_s += 1.0
    tube.rest(1.0)
    assert tube.model.attitude() is None
    assert tube.model.sigma_deg() == np.inf
    tube.solve()
    tube.push(10.0, 5.0)
    assert tube.off_deg() < 3.0 * tube.model.sigma_deg() < 1.0  # how it sits is still known
