"""The model of a gyroscope on a pushed telescope, on turns that SciPy makes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.attitude import separation_deg
from kochab.pointing.gyro import GyroModel

RATE_HZ = 50.0
NOISE_DEG_S_RT_HZ, WALK_DEG_S_RT_S = 0.007, 0.0003
"""Rate noise and bias drift of phone gyroscopes, from the data sheets named in :mod:`tests.gear.phyphox_phone`."""
UNEVEN = 0.01
"""1 sigma of scale errors and of cross-axis sensitivity: BMI160, MPU-6500."""
EARTH_DEG_S = Rotation.from_euler("Y", 42.0, degrees=True).apply((0.0, 0.0, 15.041 / 3600.0))


def _attitudes(azimuths: np.ndarray, altitudes: np.ndarray) -> Rotation:
    """From Earth-fixed directions to camera axes; z is where it looks."""
    angles = np.column_stack([azimuths, 90.0 - altitudes, np.full(len(azimuths), 30.0)])
    return Rotation.from_euler("ZYZ", angles, degrees=True).inv()


class Tube:
    """A tube on an altazimuth mount without a drive, with a gyroscope on it; time is its own."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.mounting = Rotation.random(random_state=seed)
        self.chip = np.eye(3) + self.random.normal(0.0, UNEVEN, (3, 3))
        self.rest_deg_s = self.random.normal(0.0, 0.3, 3)
        self.model = GyroModel()
        self.now_s, self.az, self.alt = 10.0, 0.0, 45.0
        self.rest(2.0)

    @property
    def attitude(self) -> np.ndarray:
        """From Earth-fixed directions to camera axes; z is where it looks."""
        return _attitudes(np.array([self.az]), np.array([self.alt])).as_matrix()[0]

    def push(self, az: float, alt: float, seconds: float = 3.0) -> None:
        """By so many degrees, beginning and ending at rest."""
        steps = round(seconds * RATE_HZ)
        eased = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, steps + 1))
        azimuths, altitudes = self.az + eased * az, self.alt + eased * alt
        self.az, self.alt = azimuths[-1], altitudes[-1]
        attitudes = _attitudes(azimuths, altitudes)
        turns = -(attitudes[1:] * attitudes[:-1].inv()).as_rotvec()
        noise, walk = np.moveaxis(self.random.standard_normal((steps, 2, 3)), 1, 0)
        rest_deg_s = self.rest_deg_s + np.cumsum(walk * (WALK_DEG_S_RT_S / np.sqrt(RATE_HZ)), axis=0)
        rates_deg_s = np.degrees(turns) * RATE_HZ + attitudes[:-1].apply(EARTH_DEG_S)
        felt = self.mounting.inv().apply(rates_deg_s) @ self.chip.T + rest_deg_s
        felt += noise * (NOISE_DEG_S_RT_HZ * np.sqrt(RATE_HZ / 2.0))
        moments = self.now_s + np.arange(1, steps + 1) / RATE_HZ
        self.rest_deg_s, self.now_s = rest_deg_s[-1], moments[-1]
        rates = np.radians(felt)
        for k in range(0, len(moments), 5):
            self.model.feel(moments[k : k + 5], rates[k : k + 5])

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


def _alone(move, tubes=24) -> tuple[np.ndarray, np.ndarray]:
    """Errors and sigmas, arcminutes, of tubes that ``move`` has pushed after four solves and without another."""
    off, sigma = [], []
    for seed in range(tubes):
        tube = Tube(seed)
        tube.learn()
        move(tube, *tube.random.uniform((-16.0, -10.0), (16.0, 10.0)))
        tube.rest(1.5)
        off.append(60.0 * tube.off_deg())
        sigma.append(60.0 * tube.model.sigma_deg())
    return np.array(off), np.array(sigma)


def test_under_a_cap_a_usual_push_is_followed_within_five_minutes_of_arc() -> None:
    off, sigma = _alone(lambda tube, az, alt: tube.push(az, alt))
    assert np.mean(off < 5.0) >= 0.95
    assert np.mean(off < 2.0 * sigma) >= 0.95
    assert np.median(sigma) < 5.0  # so well that "there" can be said


def test_under_a_cap_a_minute_of_pushes_and_rests_grows_no_more_than_its_sigma() -> None:
    """Bias drift limits every such chip; the start of a push, which looks like rest, must not add to it."""

    def nudge(tube: Tube, az: float, alt: float) -> None:
        for _ in range(8):
            tube.push(az / 8.0, alt / 8.0, 2.0)
            tube.rest(5.5)

    off, sigma = _alone(nudge, tubes=12)
    assert np.median(off) < 6.5
    assert np.mean(off < 2.0 * sigma) >= 0.95
    assert np.median(sigma) > 5.0  # and "there" is not


def test_a_push_as_slow_as_a_last_nudge_is_felt_or_doubted() -> None:
    """Taken for rest it would be 36 minutes of arc off, with a sigma of two."""
    way = 3.0**-0.5 * 0.6  # along both axes, in 30 s

    def nudge(tube: Tube, _: float, __: float) -> None:
        tube.rest(30.0)
        tube.push(way / np.cos(np.radians(tube.alt)), -(2.0**0.5) * way, 30.0)

    off, sigma = _alone(nudge, tubes=12)
    assert np.median(off) < 12.0
    assert np.mean(off < 2.0 * sigma) >= 0.8


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
