"""The bench of nights: planted faults are found with their sizes, healthy nights stay healthy."""

import os

import pytest

from kochab.lab.bench import Only, night, night_long


def test_the_bench_of_nights_finds_what_is_planted_and_invents_nothing(monkeypatch):
    monkeypatch.setattr(night, "QUICK_HEALTHY", 1)
    monkeypatch.setattr(night, "FRAMES", 38)  # the last fault is planted after 33
    result = night.run(True, lambda line: None, Only(("all faults",)))
    found = {row["fault"]: row for row in result.rows if row["night"] == "all faults 1"}
    missed = [name for name, row in found.items() if row["planted"] and not row["found"]]
    assert missed == []
    assert found["slipped clutch, arcsec"]["told"] > 400
    goals = {goal.name: goal for goal in result.goals}
    assert goals["planted numbers, worst in sigma"].met
    monkeypatch.setattr(night, "FRAMES", 8)  # a fault is invented frame by frame
    healthy = night.run(True, lambda line: None, Only(("healthy",)))
    for nights in (result, healthy):
        invented = next(goal for goal in nights.goals if goal.name == "faults invented")
        assert invented.met, [row for row in nights.rows if row["found"] and not row["planted"]]


def test_a_night_of_large_frames_is_timed_from_the_command_s_start_to_its_end(monkeypatch):
    monkeypatch.setattr(night, "QUICK_FRAMES_24_MP", 3)
    monkeypatch.setattr(night_long, "SIZE", (1500, 1000, 3.3))  # of 24 MP each takes a second more
    result = night.run(True, lambda line: None, Only((night.LONG,)))
    (row,), (goal, processor) = result.rows, result.goals
    assert row["all solved"]
    assert row["frames"] == 3
    assert goal.value == pytest.approx(row["wall, s"] * 100 / 60)
    assert processor.value == pytest.approx(row["processor, s"] * 100 / 60, nan_ok=True)
    assert processor.met is None if os.name == "nt" else processor.value > 0.0
    monkeypatch.setattr(night, "long_night", lambda *_: {**row, "all solved": False})
    assert [goal.met for goal in night.run(True, lambda line: None, Only((night.LONG,))).goals] == [None, None]
