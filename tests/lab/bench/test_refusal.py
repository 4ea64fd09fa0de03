import os

import pytest

from kochab.identification.index import SHIPPED, shipped_volume_folder
from kochab.lab.bench import refusal


def test_each_list_is_refused_from_the_disk_and_from_memory(monkeypatch) -> None:
    forgotten = []
    monkeypatch.setattr(refusal, "QUICK_LISTS", 2)
    monkeypatch.setattr(refusal, "POINTS", (5, 20))
    monkeypatch.setattr(refusal, "forget", forgotten.append)
    result = refusal.run(True, lambda _: None)
    assert [row["n"] for row in result.rows] == [2, 2]
    assert len(forgotten) == 2
    assert all(0.0 < row["median_cpu_s"] <= row["slowest_cpu_s"] for row in result.rows)
    assert next(goal for goal in result.goals if "accepted" in goal.name).met


@pytest.mark.parametrize(("load", "met"), [(1.1, False), (1.6, None)], ids=["idle", "busy"])
def test_the_slowest_list_is_what_counts_and_the_clock_on_an_idle_machine_alone(monkeypatch, load, met) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 9.0, 9.0), raising=False)
    kept = [{"wall_s": 0.1, "cpu_s": 0.1, "wrong": False}] * 9 + [{"wall_s": 0.7, "cpu_s": 0.2, "wrong": True}]
    told = refusal.row("from the disk", kept)
    goals = {goal.name: goal.met for goal in refusal.goals([told], refusal.idle())}
    assert told["median_s"] == pytest.approx(0.1)
    assert goals == {
        "random lists accepted": False,
        "slowest refusal from the disk, s, idle machine": met,
        "slowest refusal from the disk, processor s": True,
    }


@pytest.mark.skipif(not hasattr(os, "posix_fadvise"), reason="this system's page cache cannot be emptied")
def test_every_file_of_the_patterns_is_taken_out_of_the_cache(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(os, "posix_fadvise", lambda handle, *_: asked.append(os.fstat(handle).st_ino))
    folders = [shipped_volume_folder() / name for name in SHIPPED]
    refusal.forget(folders)
    files = [path for folder in folders for path in folder.glob("*.npy")]
    assert len(files) > 6
    assert {path.stat().st_ino for path in files} == set(asked)
