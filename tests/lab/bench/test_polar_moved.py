"""The polar bench's mounts that give way: what they do is what the rows say, and the scores can fail."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.lab.bench import polar_moved as bench
from kochab.polar import measure as polar_measure

ARCSEC = np.pi / 648000.0


def drawn(fault, seed=4):
    rng = np.random.default_rng(seed)
    turn = bench.turn(rng)
    matrices, axis = bench.FAULTS[fault](turn, rng)
    in_camera = Rotation.from_matrix(np.swapaxes(turn.matrices, 1, 2) @ matrices).as_rotvec() / ARCSEC
    return turn, in_camera, axis


def test_what_gives_way_is_as_large_as_its_row_says():
    turn, moved, axis = drawn("droop 120")
    level = np.hypot(*turn.matrices[:, :2, 2].T)
    assert np.linalg.norm(moved, axis=1) == pytest.approx(120.0 * level, rel=1e-6)
    turn, moved, axis = drawn("sinking 60")
    assert np.linalg.norm(moved, axis=1) == pytest.approx(60.0 * turn.share, abs=1e-6)
    assert np.arccos(axis @ turn.axis) / ARCSEC <= 60.0
    turn, moved, axis = drawn("creep 90")
    assert np.linalg.norm(moved[-1]) == pytest.approx(90.0)
    turn, moved, axis = drawn("wobble 40")
    assert np.linalg.norm(moved, axis=1) == pytest.approx(40.0)
    turn, moved, axis = drawn("Dec play 60")
    assert set(np.round(np.linalg.norm(moved, axis=1), 3)) == {0.0, 60.0}
    in_camera_axis = turn.matrices[0].T @ turn.axis
    assert abs(moved[-1] @ in_camera_axis) < 1e-6
    turn, moved, axis = drawn("periodic error 60")
    in_ground = np.einsum("kij,kj->ki", turn.matrices, moved)
    assert np.linalg.norm(np.cross(in_ground, turn.axis), axis=1) == pytest.approx(0.0, abs=1e-6)


def test_frames_stand_high_enough_and_half_are_in_even_steps():
    turns = [bench.turn(np.random.default_rng([1, k])) for k in range(60)]
    assert all(t.matrices[:, 2, 2].min() > np.sin(np.radians(15.0)) for t in turns)
    longer = [t for t in turns if len(t.share) > 2]
    even = [np.ptp(np.diff(t.turns_rad)) < 1e-9 for t in longer]
    assert 0.25 < np.mean(even) < 0.75
    assert all(30.0 <= np.degrees(np.ptp(t.turns_rad)) <= 90.0 for t in turns)


@pytest.mark.parametrize(("fault", "least"), [("creep 90", 11), ("sinking 60", 10), ("droop 120", 10)])
def test_the_ellipse_holds_what_frames_cannot_show_and_would_not_without_the_priors(fault, least, monkeypatch):
    assert sum(bench.measure_moved(fault, seed)["in_95"] for seed in range(12)) >= least
    if fault == "droop 120":
        return
    monkeypatch.setattr(polar_measure, "undetected_creep_covariance", lambda *_: np.zeros((2, 2)))
    assert sum(bench.measure_moved(fault, seed)["in_95"] for seed in range(12)) < least


def test_a_sound_mount_is_inside_its_narrow_ellipse_and_is_not_accused():
    rows = [bench.measure_moved("nothing", seed) for seed in range(12)]
    assert sum(row["noise_95"] for row in rows) >= 10
    assert not any(row["spoilt"] for row in rows)
    assert rows == [bench.measure_moved("nothing", seed) for seed in range(12)]


def test_rows_and_goals(monkeypatch):
    monkeypatch.setattr(bench, "QUICK", 2)
    said = []
    rows, goals = bench.moved_rows(True, said.append)
    assert [row["kind"] for row in rows] == [f"gives way: {fault}" for fault in bench.FAULTS]
    assert len(goals) == len(rows)
    assert len(said) == 1 + len(rows), "each as soon as it is measured"
    assert all(goal.met == (goal.value >= bench.LEAST_INSIDE) for goal in goals)
