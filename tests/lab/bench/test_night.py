"""The bench of nights: planted faults are found with their sizes, healthy nights stay healthy."""

from kochab.lab.bench import night


def test_the_bench_of_nights_finds_what_is_planted_and_invents_nothing(monkeypatch):
    monkeypatch.setattr(night, "QUICK_HEALTHY", 1)
    result = night.run(True, lambda line: None)
    found = {row["fault"]: row for row in result.rows if row["night"] == "all faults 1"}
    missed = [name for name, row in found.items() if row["planted"] and not row["found"]]
    assert missed == []
    assert found["slipped clutch, arcsec"]["told"] > 400
    goals = {goal.name: goal for goal in result.goals}
    assert goals["faults invented"].met, [row for row in result.rows if row["found"] and not row["planted"]]
    assert goals["planted numbers, worst in sigma"].met
