"""Encoders aligned by solves, against mounts built here from plain rotations."""

import math
import random

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.pointing.encoders import EncoderModel, earth_fixed

PUSHES = [(14.0, -6.0), (-25.0, 9.0), (40.0, 5.0), (11.0, -8.0), (-60.0, 4.0)]
LATITUDE = 48.0


class Mount:
    """Two axes on a leaning base, a camera that sits askew, and encoders; scipy turns it."""

    def __init__(self, seed, counts=(8192, -10000), lean_deg=1.5, cone_deg=1.0, polar=False):
        chance = self.chance = random.Random(seed)
        lean = [chance.gauss(0.0, lean_deg), chance.gauss(0.0, lean_deg), 0.0]
        self.base = Rotation.from_rotvec(np.radians(lean))
        if polar:
            self.base = Rotation.from_euler("x", LATITUDE - 90.0, degrees=True) * self.base
        self.in_a_turn = counts
        sits = [chance.uniform(-180, 180), chance.gauss(0.0, cone_deg), chance.gauss(0.0, cone_deg)]
        self.camera = Rotation.from_euler("zyx", sits, degrees=True)
        self.first, self.second = chance.uniform(-180, 180), chance.uniform(25, 65)
        self.zeros = chance.randrange(-3000, 3000), chance.randrange(-3000, 3000)

    def push(self, first, second):
        self.first, self.second = self.first + first, self.second + second

    @property
    def attitude(self):
        """East, north, up to camera x, y, z."""
        tube = self.base * Rotation.from_euler("ZY", [self.first, -self.second], degrees=True)
        noise = Rotation.from_rotvec(np.radians([self.chance.gauss(0, s / 3600.0) for s in (5.0, 5.0, 60.0)]))
        looks_along_x = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T  # columns: where x, y, z look
        axes = (tube.as_matrix() @ looks_along_x.T) @ self.camera.as_matrix() @ noise.as_matrix()
        return axes.T

    @property
    def counts(self):
        turns = zip((self.first, self.second), self.in_a_turn, self.zeros, strict=True)
        return tuple(float(round(angle / 360.0 * steps) + zero) for angle, steps, zero in turns)


def off_deg(model, mount):
    told, true = model.attitude(mount.counts)[2], mount.attitude[2]
    return math.degrees(math.atan2(np.linalg.norm(np.cross(told, true)), told @ true))


def align(model, mount, pushes=PUSHES):
    told = []
    for push in pushes:
        told.append(model.see(mount.attitude, mount.counts))
        mount.push(*push)
    return [*told, model.see(mount.attitude, mount.counts)]


@pytest.mark.parametrize("polar", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_after_a_few_solves_the_counts_alone_lead_within_five_minutes_of_arc(seed, polar) -> None:
    """Counts a turn, sense, lean, cone and the kind of base are learned; nobody has said any."""
    mount, model = Mount(seed, polar=polar), EncoderModel(LATITUDE)
    assert not any(align(model, mount))
    for push in ((20.0, -7.0), (-30.0, 12.0)):
        mount.push(*push)
        assert off_deg(model, mount) < 5.0 / 60.0
        assert off_deg(model, mount) < 3.0 * model.sigma_deg(mount.counts)
    for learned, true in zip(model.counts_in_a_turn, mount.in_a_turn, strict=True):
        assert abs(learned) == pytest.approx(abs(true), rel=0.005)


@pytest.mark.parametrize("seed", range(8))
def test_two_solves_show_counts_and_sense_of_both_axes(seed) -> None:
    mount, model = Mount(seed, lean_deg=0.0, cone_deg=0.0), EncoderModel()  # the frame's z axis is the mount's
    assert model.counts_in_a_turn == (None, None)
    model.see(mount.attitude, mount.counts)
    assert model.counts_in_a_turn == (None, None)
    assert off_deg(model, mount) < 0.01
    mount.push(12.0, 8.0)
    assert model.sigma_deg(mount.counts) > 5.0  # nobody knows yet how far that was
    model.see(mount.attitude, mount.counts)
    mount.push(9.0, -8.0)
    assert off_deg(model, mount) < 3.0 * model.sigma_deg(mount.counts)
    assert model.sigma_deg(mount.counts) < 1.5  # a base may lean and a camera sit askew


def test_the_uncertainty_grows_with_the_way_and_the_time_since_the_last_solve() -> None:
    mount, model = Mount(2), EncoderModel(LATITUDE)
    align(model, mount)
    told = [model.sigma_deg(mount.counts)]
    for push in ((2.0, 1.0), (20.0, 5.0), (40.0, 5.0)):
        mount.push(*push)
        told.append(model.sigma_deg(mount.counts))
    assert told == sorted(told)
    assert model.sigma_deg(mount.counts, 600.0) > told[-1] + 1e-3


def test_most_errors_lie_within_the_uncertainty() -> None:
    """After three to six solves, about 99 % of 40 pushes should end within 3 sigma; the error is two-dimensional."""
    within = []
    for seed in range(20, 30):
        mount, model = Mount(seed, polar=seed % 2 == 0), EncoderModel(LATITUDE)
        align(model, mount, PUSHES[:2])
        for push in ((15.0, -4.0), (-22.0, 7.0), (9.0, 9.0), (30.0, -9.0)):
            mount.push(*push)
            within.append(off_deg(model, mount) < 3.0 * model.sigma_deg(mount.counts))
            model.see(mount.attitude, mount.counts)
    assert sum(within) >= 38


def test_a_slip_is_told_with_its_size_and_what_was_learned_stays() -> None:
    mount, model = Mount(5), EncoderModel(LATITUDE)
    align(model, mount)
    mount.zeros = mount.zeros[0], mount.zeros[1] + 60  # 60 of 10,000 counts: 2.16 degrees
    assert model.see(mount.attitude, mount.counts) == pytest.approx(2.16, abs=0.1)
    mount.push(15.0, -6.0)
    assert off_deg(model, mount) < 5.0 / 60.0
    assert model.see(mount.attitude, mount.counts) is None


def test_a_box_that_was_switched_off_and_on_begins_at_zero_and_is_taken_up() -> None:
    mount, model = Mount(6), EncoderModel(LATITUDE)
    align(model, mount)
    mount.zeros = tuple(zero - count for zero, count in zip(mount.zeros, mount.counts, strict=True))
    assert model.see(mount.attitude, mount.counts) is not None
    mount.push(15.0, -6.0)
    assert off_deg(model, mount) < 5.0 / 60.0


def test_other_encoders_are_learned_anew() -> None:
    mount, model = Mount(7), EncoderModel(LATITUDE)
    align(model, mount)
    mount.in_a_turn = (-4000, 4000)
    told = align(model, mount, [*PUSHES, *PUSHES])
    assert any(told)
    assert told[-3:] == [None] * 3
    mount.push(10.0, 4.0)
    assert off_deg(model, mount) < 5.0 / 60.0


def test_an_equatorial_mount_is_pushed_through_its_pole() -> None:
    """The other side of the pier: the declination falls while its axis goes on. No site is known."""
    mount, model = Mount(9, lean_deg=0.5), EncoderModel()  # the frame's z axis is the mount's
    mount.second = 40.0
    align(model, mount, ((14.0, 6.0), (-25.0, 9.0), (30.0, 5.0), (11.0, 8.0)))
    mount.push(30.0, 40.0)
    assert mount.second > 90.0
    assert off_deg(model, mount) < 10.0 / 60.0
    assert model.see(mount.attitude, mount.counts) is None
    mount.push(-10.0, 10.0)
    assert off_deg(model, mount) < 5.0 / 60.0


def test_an_attitude_from_two_directions_looks_at_the_first_with_the_second_along_its_x() -> None:
    """However far apart refraction has moved them."""
    rng = np.random.default_rng(3)
    for apart in (1e-4, 0.3, 1.2):
        first, second = rng.normal(size=(2, 3))
        first /= np.linalg.norm(first)
        second = np.cos(apart) * first + np.sin(apart) * np.cross(first, second) / np.linalg.norm(
            np.cross(first, second)
        )
        matrix = earth_fixed(np.stack([first, second]))
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
        np.testing.assert_allclose(matrix @ first, [0.0, 0.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(matrix @ second, [np.sin(apart), 0.0, np.cos(apart)], atol=1e-9)
