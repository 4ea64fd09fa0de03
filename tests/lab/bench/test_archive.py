"""The bench of archives: what it counts in a table, what it makes of it, and a small run."""

from collections import namedtuple
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pytest

from kochab.lab.bench import Only, archive, measure_rows
from kochab.lab.bench.archive import Ran, archived, goals, row, write_lists

START = datetime(2026, 1, 1, tzinfo=UTC)


def table(urls, step_s=0.5):
    count = len(urls)
    return pa.table(
        {
            "url": urls,
            "done_utc": [START + timedelta(seconds=step_s * k) for k in range(count)],
            "solved": [True] * count,
            "cpu_s": [9.0, *[0.02] * (count - 1)],
            "read_bytes": [3000] * count,
        }
    )


def test_inputs_without_a_row_and_rows_too_many_are_counted() -> None:
    urls = [f"u{k}" for k in range(20)]
    found = row("x", 1, 20, Ran(30.0, 4.0, 100.0, table(urls), 3.0))
    assert (found["astray"], found["solved"]) == (0, 20)
    assert found["rate_s"] == pytest.approx(2.0)
    assert (found["cpu_ms"], found["all_ms"], found["read_kb"]) == (20.0, 200.0, 3.0)
    assert found["main_percent"] is None
    assert row("x", 1, 20, Ran(1, 1, 1, table(urls[1:]), 0))["astray"] == 1
    assert row("x", 1, 20, Ran(1, 1, 1, table([*urls, "u3", "u3"]), 0))["astray"] == 2
    assert row("x", 1, 20, Ran(1, 1, 1, table([*urls[1:], "u3"]), 0))["astray"] == 2


def test_what_gathers_is_compared_with_the_workers_of_the_same_while() -> None:
    """From the first tenth of the rows to the last: the start of all processes is not in it."""
    urls = [f"u{k}" for k in range(20)]
    spent = [(START.timestamp() + k, 5.0 + 0.1 * k, 7.0 + 1.9 * k) for k in range(9)]
    spent[0] = (START.timestamp(), 0.0, 0.0)
    found = row("x", 2, 20, Ran(30.0, 4.0, 100.0, table(urls), 3.0, 0, spent))
    assert found["main_percent"] == pytest.approx(5.0)
    assert found["mid_ms"] == pytest.approx(1000.0)  # 2.0 s of both a second, two inputs a second
    assert row("x", archive.APART, 20, Ran(30.0, 4.0, 100.0, table(urls), 3.0, 0, spent))["main_percent"] is None
    lost = [*spent[:6], (spent[6][0], spent[6][1], 1.0)]  # a worker was killed, with its time
    found = row("x", 2, 20, Ran(30.0, 4.0, 100.0, table(urls), 3.0, 0, lost))
    assert np.isnan(found["main_percent"])
    assert np.isnan(found["mid_ms"])


def test_what_the_machine_uses_counts_its_host_and_guests_once() -> None:
    Times = namedtuple("Times", "user nice system idle iowait steal guest guest_nice")
    assert archive._used_s(Times(5.0, 1.0, 2.0, 100.0, 10.0, 4.0, 3.0, 1.0)) == 12.0
    assert archive._dirty_kb("Rss: 9 kB\nPrivate_Clean: 7 kB\nPrivate_Dirty:  1000 kB\n") == 1024.0
    assert archive._dirty_kb("") == 0.0  # of one that has ended


def test_two_programs_share_the_lists(tmp_path) -> None:
    write_lists(tmp_path / "lists.parquet", 12)
    found = row("star lists", archive.APART, 12, archived(tmp_path / "lists.parquet", tmp_path / "out", archive.APART))
    assert (found["astray"], found["solved"]) == (0, 12)


def test_two_workers_are_compared_on_a_quiet_machine_alone() -> None:
    def one(what, workers, rate, cpu, busy, **more):
        numbers = {"rate_s": rate, "cpu_ms": cpu, "busy": busy, "main_percent": None, "mid_ms": np.nan}
        return {"inputs": what, "workers": workers, **numbers, **more}

    rows = [
        one("star lists", 1, 100.0, 9.0, 2.0),
        one("star lists", 2, 190.0, 9.5, 1.0, main_percent=6.0, mid_ms=10.0),
        one("star lists", archive.APART, 195.0, 9.5, 1.0, mid_ms=9.5),
        one("star lists", 1, 90.0, 9.1, 2.0),  # a turn that was disturbed
        one("1.5 MP frames", 1, 20.0, 40.0, 2.0),
        one("1.5 MP frames", 2, 25.0, 50.0, 80.0),
        one(archive.KILLED, 2, 1.0, 1.0, 0.0, kills=20, count=100_000, astray=1),
    ]
    found = {goal.name: (goal.value, goal.met) for goal in goals(rows)}
    assert found["star lists: two workers, times as fast as one"] == (1.9, True)
    assert found["star lists: two workers, times as fast as two programs"] == (190.0 / 195.0, True)
    assert found["star lists: two programs, times as fast as one (this machine's limit)"] == (1.95, True)
    assert found["star lists: the same by processor time of all processes"] == (0.95, True)
    assert found["star lists: processor of the process that gathers, percent"] == (6.0, False)
    assert found["1.5 MP frames: two workers, times as fast as one"] == (None, None)
    assert found["1.5 MP frames: two workers, times as fast as two programs"] == (None, None)
    assert found["1.5 MP frames: the same by processor time of all processes"] == (None, None)
    assert found["1.5 MP frames: processor of the process that gathers, percent"] == (None, None)
    assert found["1.5 MP frames: the same by processor time"] == (1.6, False)
    assert found["of these without exactly one row"] == (1.0, False)
    assert found["frames on S3 without exactly one row"] == (None, None)


def test_rows_are_measured_alone(monkeypatch) -> None:
    asked = []

    def archived(given, out, workers, storage=None):
        asked.append((given.name, workers))
        return Ran(1.0, 1.0, 1.0, table([f"u{k}" for k in range(10)]), 0.0)

    monkeypatch.setattr(archive, "archived", archived)
    monkeypatch.setattr(archive, "QUICK_LISTS", 2)
    result = measure_rows("archive", True, lambda line: None, Only(("star lists",)))
    assert asked == [("few.parquet", 1), ("few.parquet", 2), ("few.parquet", archive.APART)] * archive.TURNS
    assert {one["inputs"] for one in result.rows} == {"star lists"}


def test_a_small_archive_is_measured(tmp_path) -> None:
    write_lists(tmp_path / "lists.parquet", 12)
    ran = archived(tmp_path / "lists.parquet", tmp_path / "out", 1)
    found = row("star lists", 1, 12, ran)
    assert (found["astray"], found["solved"], found["kills"]) == (0, 12, 0)
    assert found["cpu_ms"] > 0.5
    assert found["peak_mb"] > 20.0
    assert found["all_ms"] > found["cpu_ms"]


def test_frames_differ_in_a_pixel(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(archive, "SMALL", (300, 200, 8.0))
    archive.write_frames(tmp_path / "f", 3)
    contents = [path.read_bytes() for path in sorted((tmp_path / "f").iterdir())]
    assert len(set(contents)) == 3
    assert len({len(content) for content in contents}) == 1
