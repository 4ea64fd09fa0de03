"""The people at the bolts: their mount against erfa and closed forms, and where the tutor leads some of them."""

import math
from dataclasses import replace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.polar.error import Knob
from kochab.polar.tutor import Instruction, TutorStep
from tests.nights.hands import ARCSEC, KINDS, SIDEREAL_RAD_S, Bolt, Hand, Mount, run

BY_NAME = {kind.name: kind for kind in KINDS}


@pytest.mark.parametrize("seed", range(6))
def test_two_frames_turn_about_the_axis_that_the_mount_says_it_has(seed):
    """Also after its bolts were turned; the axis of the rotation from one frame to the next is scipy's."""
    mount = Mount(BY_NAME["steady"], seed)
    for _ in range(2):
        turn = mount._matrix(0.7) * mount._matrix(0.0).inv()
        assert turn.as_rotvec() == pytest.approx(0.7 * mount.axis, abs=1e-9)
        mount.turn(Knob.ALTITUDE, 0.2)
        mount.turn(Knob.AZIMUTH, -0.3)


@pytest.mark.parametrize("seed", range(6))
def test_the_drive_of_an_aligned_mount_follows_a_star(seed):
    """Hour angle and declination are erfa's: one grows with the sidereal time, the other stays."""
    mount = Mount(BY_NAME["steady"], seed)
    latitude = math.radians(mount.site_of.latitude_deg)
    mount.pole_azimuth, mount.pole_altitude = (0.0, latitude) if latitude > 0 else (math.pi, -latitude)
    mount.altitude = mount.azimuth = 0.0
    places = []
    for mount.seconds in (0.0, 3000.0):
        east, north, up = mount._matrix(0.0).as_matrix()[:, 2]
        places.append(erfa.ae2hd(math.atan2(east, north), math.asin(up), latitude))
    turned = math.remainder(places[1][0] - places[0][0], 2 * math.pi)
    assert turned == pytest.approx(3000 * SIDEREAL_RAD_S, abs=1e-9)
    assert places[1][1] == pytest.approx(places[0][1], abs=1e-9)


def test_a_wrong_clock_turns_the_error_and_leaves_its_size():
    """Six hours: what is above the pole seems to be beside it."""
    mount = Mount(BY_NAME["clock 6 h wrong"], 4)
    latitude = math.radians(mount.site_of.latitude_deg)
    celestial = np.array([0.0, math.cos(latitude), math.sin(latitude)])
    seen = mount._clock().apply(mount.axis)
    assert seen @ celestial == pytest.approx(mount.axis @ celestial, abs=1e-12)
    across = [vector - (vector @ celestial) * celestial for vector in (mount.axis, seen)]
    assert across[0] @ across[1] == pytest.approx(0, abs=1e-4 * np.linalg.norm(across[0]))


def test_play_is_crossed_before_a_bolt_moves_the_axis_the_other_way():
    bolt = Bolt(1000.0, 0.2, 0.0)
    assert [bolt.turn(turns) for turns in (0.5, -0.1, -0.3, 0.2, 0.4)] == pytest.approx([300, 0, -200, 0, 400])


def test_solved_attitudes_have_the_noise_that_they_claim():
    mount = Mount(BY_NAME["steady"], 2)
    true = mount._matrix(0.0)
    errors = [(true.inv() * Rotation.from_matrix(mount.attitude().matrix)).as_rotvec() / ARCSEC for _ in range(400)]
    assert np.std(errors, axis=0) == pytest.approx([2, 2, 20], rel=0.12)


def told(knob, turns, step=TutorStep.TURN):
    return Instruction(step, "", knob, turns)


def test_a_hand_that_overshoots_goes_five_arcmin_too_far_in_four_turns_of_ten():
    mount = Mount(replace(BY_NAME["overshoots 5 arcmin"], coarse=0.0), 1)
    hand, beyond = Hand(mount.kind, mount), []
    for _ in range(300):
        mount.azimuth = 0.0
        hand.follow(told(Knob.AZIMUTH, 0.1))
        moved = mount.azimuth / ARCSEC - 0.1 * mount.bolts[Knob.AZIMUTH].arcsec_a_turn
        beyond.append(abs(moved) * math.cos(mount.pole_altitude))
    assert np.mean(np.array(beyond) > 1) == pytest.approx(0.4, abs=0.08)
    assert max(beyond) == pytest.approx(300, abs=1e-6)


def test_a_hand_turns_the_other_bolt_in_every_second_test_and_never_in_a_turn():
    mount = Mount(BY_NAME["other axis in the test"], 1)
    hand = Hand(mount.kind, mount)
    other = {TutorStep.TEST: 0, TutorStep.TURN: 0}
    for step in other:
        for _ in range(200):
            before = mount.azimuth
            hand.follow(told(Knob.ALTITUDE, 0.1, step))
            other[step] += mount.azimuth != before
    assert other[TutorStep.TEST] == pytest.approx(100, abs=25)
    assert other[TutorStep.TURN] == 0


def test_a_seed_is_a_hand():
    assert run(BY_NAME["slips"], 7) == run(BY_NAME["slips"], 7)


HANDS = 3
"""Of each kind here; `make nights` and `kochab bench polar` run 80."""


@pytest.mark.parametrize("name", [name for name in BY_NAME if not name.startswith("clock")])
def test_hands_end_nearer_than_they_began_and_most_of_them_below_a_minute_of_arc(name):
    """Chance may let one of these fail in 30 instructions: it may turn the wrong bolt in the last of them."""
    ended = [run(BY_NAME[name], 2001 + number) for number in range(HANDS)]
    assert all(one.ended_arcsec < one.began_arcsec for one in ended), ended
    assert sum(one.ended_arcsec < 60.0 for one in ended) >= HANDS - 1, ended
    assert not any(one.accused for one in ended), ended
    assert max(one.blind_turns for one in ended) <= 0.25, "nobody knows yet what a bolt does that nobody has turned"


def test_a_clock_six_hours_wrong_is_named_before_anything_gets_worse():
    for number in range(HANDS):
        one = run(BY_NAME["clock 6 h wrong"], 2001 + number)
        assert one.ended_arcsec < one.began_arcsec
        assert one.instructions <= 12
        assert "Check the clock and time zone" in one.told[-1]


@pytest.mark.parametrize("seed", [888156, 888333, 888335])
def test_a_rough_hand_is_measured_until_the_uncertainty_is_small(seed):
    """Two sweeps of noisy frames, 29 arcsec of uncertainty together, had let it stop 61 to 79 arcsec away."""
    (kind,) = (kind for kind in KINDS if kind.name == "overshoots 5 arcmin")
    assert run(kind, seed).ended_arcsec < 60.0
