from kochab.core.solution import NoSolution, Reason
from kochab.lab.bench import narrow


def test_each_case_is_solved_and_points_are_refused(monkeypatch) -> None:
    monkeypatch.setattr(narrow, "QUICK_FIELDS", 3)
    monkeypatch.setattr(narrow, "QUICK_POINTS", 3)
    result = narrow.run(True, lambda _: None)
    assert [row["n"] for row in result.rows] == [3] * 4
    assert [row["found_percent"] for row in result.rows] == [100.0, 100.0, 100.0, 0.0]
    assert all(0.0 < row["median_cpu_ms"] <= row["slowest_cpu_ms"] for row in result.rows)
    assert {goal.name: goal.met for goal in result.goals}["wrong answers"]


def test_what_finds_nothing_meets_no_goal(monkeypatch) -> None:
    def refuse(*_):
        return NoSolution(Reason.NO_PATTERN_AGREED, "")
        yield

    monkeypatch.setattr(narrow, "QUICK_FIELDS", 2)
    monkeypatch.setattr(narrow, "QUICK_POINTS", 1)
    monkeypatch.setattr(narrow, "solve_detections", refuse)
    met = {goal.name: goal.met for goal in narrow.run(True, lambda _: None).goals}
    assert [met[f"{case.name}, % found"] for case in narrow.CASES] == [False] * 3
