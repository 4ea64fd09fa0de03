"""A bench's result in its two forms."""

import argparse
import json

import numpy as np
import pytest

from kochab.core.errors import UsageError
from kochab.lab import bench
from kochab.lab.bench import BENCHES, BenchResult, Goal, Only, command, load_bench, measure_rows, reported, table


def _result():
    rows = [{"name": "a", "ms": np.float64(1.5)}, {"name": "b", "found": np.int64(3), "ms": np.nan}]
    goals = [Goal.at_most("ms", 1.5, 2.0), Goal.at_least("found", 3, 4), Goal.at_most("none", None, 1)]
    return BenchResult("x", rows, goals)


def test_json_has_the_agreed_keys_and_only_plain_values():
    data = json.loads(json.dumps(_result().as_json(), allow_nan=False))
    assert list(data) == ["bench", "machine", "rows", "goals"]
    assert data["rows"] == [{"name": "a", "ms": 1.5}, {"name": "b", "found": 3, "ms": None}]
    assert data["goals"] == [
        {"name": "ms", "value": 1.5, "goal": "<= 2", "met": True},
        {"name": "found", "value": 3, "goal": ">= 4", "met": False},
        {"name": "none", "value": None, "goal": "<= 1", "met": None},
    ]


def test_text_lines_up_and_tells_what_is_not_met():
    lines = table(_result().rows).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert lines[0].split() == ["name", "ms", "found"]
    assert lines[1].split() == ["a", "1.5", "-"]
    text = _result().as_text()
    assert "NOT MET  found: 3 (goal >= 4)" in text
    assert "not measured  none: -" in text


def test_a_goal_at_its_limit_is_met():
    assert Goal.at_most("", 2.0, 2.0).met
    assert Goal.at_least("", 2.0, 2.0).met


def test_benches_are_chosen_by_name():
    assert {"detect", "identify"} <= set(BENCHES)
    assert callable(load_bench("detect"))
    with pytest.raises(UsageError, match="no bench called y"):
        load_bench("y")


def test_rows_are_wanted_by_how_their_names_begin():
    only = Only(("evening: kick", "align"))
    assert [only(row) for row in ("evening: kick, 3 frames", "evening: healthy", "align")] == [True, False, True]
    assert [only.some(rows) for rows in ("evening: ", "hands: ", "align")] == [True, False, True]
    assert Only()("anything")
    assert Only().some("anything: ")


def by_rows(quick, report, only):
    rows = [reported({"kind": kind}, report) for kind in ("a: 1", "a: 2", "b") if only(kind)]
    return BenchResult("x", rows, [])


def test_the_command_measures_the_rows_that_are_asked_for_and_tells_each(monkeypatch, capsys):
    monkeypatch.setitem(bench.BY_ROWS, "polar", f"{__name__}:by_rows")
    parser = argparse.ArgumentParser()
    command.add_parser(parser.add_subparsers())
    assert command.run(parser.parse_args(["bench", "polar", "--json", "--only", "a: 2", "b"])) == 0
    out, told = capsys.readouterr()
    assert [row["kind"] for row in json.loads(out)["rows"]] == ["a: 2", "b"]
    assert [json.loads(line) for line in told.splitlines()] == [{"kind": "a: 2"}, {"kind": "b"}]


def test_rows_that_no_bench_has_are_one_clear_sentence(monkeypatch):
    monkeypatch.setitem(bench.BY_ROWS, "polar", f"{__name__}:by_rows")
    with pytest.raises(UsageError, match="No row of bench polar begins with 'c' or 'd'"):
        measure_rows("polar", True, print, Only(("c", "d")))
    others = "archive, mount, night, polar, reach, serve"
    with pytest.raises(UsageError, match=f"rows of bench sky can't be measured one by one; those of {others} can"):
        measure_rows("sky", True, print, Only(("a",)))


def test_every_bench_by_rows_is_the_bench_of_that_name():
    assert all(bench.BENCHES[name] == path for name, path in bench.BY_ROWS.items())
