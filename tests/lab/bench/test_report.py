"""A bench's result in its two forms."""

import json

import numpy as np
import pytest

from kochab.core.errors import UsageError
from kochab.lab.bench import BENCHES, BenchResult, Goal, load_bench, table


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
