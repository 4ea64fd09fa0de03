from collections import Counter

import numpy as np
import pytest

from kochab.core.errors import LineLostError
from kochab.lab.bench import soak
from kochab.workflows.live import capture


@pytest.fixture
def short(monkeypatch):
    """Turns of few solves, in which every fault comes within two dozen frames."""
    monkeypatch.setattr(soak, "LISTS_A_TURN", 2)
    monkeypatch.setattr(soak, "SOLVES_A_TURN", 2 + soak.LIVE_A_TURN + 2)
    monkeypatch.setattr(soak, "FIELDS_DEG", (12.0, 25.0))
    monkeypatch.setattr(capture, "RETRY_S", 0.01)


def test_a_short_soak_solves_meets_faults_and_measures(short, tmp_path) -> None:
    told = []
    row = soak.soak(4, tmp_path, told.append)
    assert row["solves"] == 32
    assert row["solved"] + row["refused"] + row["bad files"] == 4 * 4
    assert row["bad files"] == 2  # one cut, one garbled
    assert row["live solved"] + row["live not solved"] == 16
    assert row["live solved"] > 8
    assert row["live_hours"] == pytest.approx(soak.PACED_HOURS, rel=0.02)
    assert row["own_mb"] > 20
    assert len(told) == 4
    goals = {goal.name: goal.met for goal in soak.goals(row)}
    assert goals["solves for that"] is None


@pytest.mark.parametrize("away_s", [0.01, 1.0], ids=["back at once", "missed meanwhile"])
def test_an_unplugged_camera_comes_back_with_the_frame_it_owed(short, monkeypatch, away_s) -> None:
    monkeypatch.setattr(capture, "RETRY_S", away_s)
    camera, counts = soak.FaultyCamera(soak.night_rig(), 5.0), Counter()
    camera.number = before = 10 * soak.CYCLE + soak.UNPLUGGED - 2  # the second frame is the one
    live = soak.live_solve(soak.Capture(lambda: camera, reconnect=True), soak.ProfiledTracker())
    soak.watch(live, camera, counts)
    live.close()
    assert camera.number == before + soak.LIVE_A_TURN + 1
    assert counts["live solved"] + counts["live not solved"] == soak.LIVE_A_TURN
    assert counts["warnings"] == 1


def test_faults_come_in_their_turn() -> None:
    camera = soak.FaultyCamera(soak.night_rig(), 5.0)
    assert camera.next_frame(0.0) is None  # nothing was asked for
    seen = {}
    for number in (1, 7, 17, 27):
        camera.number = number - 1
        camera.ask()
        seen[number] = camera.next_frame(1.0).pixels
    assert seen[1].shape == seen[7].shape == seen[17].shape == (480, 640)
    assert not seen[7].any()
    assert np.std(seen[17]) > 10 * np.std(seen[1])
    assert seen[27].shape == (60, 80)
    camera.number = soak.UNPLUGGED - 1
    camera.ask()
    with pytest.raises(LineLostError):
        camera.next_frame(1.0)


def test_so_much_of_the_night_passes_between_two_frames() -> None:
    camera = soak.FaultyCamera(soak.night_rig(), 14.0)
    for _ in range(6):
        camera.ask()
        assert camera.next_frame(1.0) is not None
    assert camera.rig.clock.now_unix() - camera.rig.start_unix == pytest.approx(6 * 14.0, rel=0.01)


def test_growth_is_held_against_the_goal() -> None:
    row = {"solves": 20_000, "live_hours": 8.1, "resident_growth": 0.04, "own_growth": 0.06}
    assert [goal.met for goal in soak.goals(row)] == [True, False, True, True]
