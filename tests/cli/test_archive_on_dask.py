"""``kochab archive`` on Dask: workers that are killed, inputs that kill them, Ctrl-C, a scheduler of somebody else's.

A cluster of real processes takes two seconds to start: there are few.
"""

import gc
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from kochab.cli import cluster as cluster_module
from kochab.cli.cluster import SETTINGS, WAITING, Workers, _result, cluster, on_cluster
from kochab.core.errors import UsageError
from kochab.solver import SolveOptions
from kochab.workflows.archive.inputs import Item
from kochab.workflows.archive.row import Recipe
from kochab.workflows.archive.run import Chunk, Outcome
from tests.cli.archive_inputs import CENTRES, archive, rows_of, write_lists
from tests.cli.poisoned import ends_for_poison, told_as_lost

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
TOLD_AT_ONCE = (
    "import sys, time, kochab.workflows.archive.run as run; run.STATE_S, take = 0, run.Run.take\n"
    "run.Run.take = lambda self, outcome: (take(self, outcome), time.sleep(0.3))\n"
    "from kochab.__main__ import main; sys.exit(main())"
)
"""A run that tells of each chunk when it has it, and then takes its time: it must still be at work when that is seen."""
KOCHAB = [sys.executable, "-c", TOLD_AT_ONCE, "archive"]


def begun(folder: Path, *arguments) -> subprocess.Popen:
    """The command in a session of its own, as a terminal gives it one."""
    return subprocess.Popen(
        [*KOCHAB, *map(str, arguments), "--out", folder],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def workers_of(process) -> list[psutil.Process]:
    """The processes that Dask has made for it."""
    try:
        below = psutil.Process(process.pid).children(recursive=True)
        return [child for child in below if "spawn_main" in " ".join(child.cmdline())]
    except psutil.Error:  # one ended this moment
        return []


def has_rows(out: Path) -> bool:
    """Whether a run has told of some."""
    state = out / "_kochab" / "run-all.json"
    try:
        return bool(json.loads(state.read_text())["done"])
    except (OSError, ValueError):
        return False


@pytest.mark.parametrize("while_it", ["starts", "works"])
def test_ctrl_c_leaves_whole_parts_and_no_worker_and_the_next_run_does_each_list_once(
    tmp_path, capsys, while_it
) -> None:
    """A terminal sends it to the workers too; people press it twice."""
    lists, out = tmp_path / "lists.parquet", tmp_path / "out"
    times = 2 if while_it == "starts" else 4
    count = times * len(CENTRES)
    write_lists(lists, CENTRES * times)
    process = begun(out, lists, "--workers", "2")
    seen: set[psutil.Process] = set()
    until = time.monotonic() + 100
    try:
        while process.poll() is None and time.monotonic() < until:
            seen |= set(workers_of(process))
            if seen if while_it == "starts" else has_rows(out):
                break
            time.sleep(0.01)
        for _ in range(2):
            os.killpg(process.pid, signal.SIGINT)
            time.sleep(0.1)
        told, errors = process.communicate(timeout=100)
    finally:
        process.kill()
    assert process.returncode == 130
    assert "the same command goes on from here" in told
    assert "Traceback" not in errors
    _, left = psutil.wait_procs(list(seen), timeout=120)
    assert left == []
    assert list(out.glob("_kochab/*.draft")) == []
    done = len(rows_of(out)) if while_it == "works" else 0
    assert (0 < done < count) is (while_it == "works")
    went_on = archive(capsys, lists, "--out", out, "--workers", "1")
    assert (went_on["before"], went_on["done"]) == (done, count - done)
    assert len(rows_of(out)) == count


@pytest.fixture(scope="module")
def workers():
    """Two, for tests that leave as many; Dask gives up a chunk at its first lost worker, and more of them are suspected."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SETTINGS, "distributed.scheduler.allowed-failures", 0)
        with cluster(None, 2) as two:
            yield two


def test_what_kills_every_worker_is_told_and_costs_no_other_its_row(workers) -> None:
    names = ["a", "b", "poison", "c", "d", "e", "f", "g"]
    recipe = Recipe(SolveOptions())
    chunks = [
        Chunk(tuple(Item(name, "", 0) for name in names[k : k + 4]), ("",) * 4, recipe) for k in range(0, len(names), 4)
    ]
    outcomes = list(on_cluster(workers, iter(chunks), ends_for_poison, told_as_lost))
    rows = [row for outcome in outcomes for row in outcome.rows]
    assert sorted(row["url"] for row in rows) == sorted(names)
    assert [row["url"] for row in rows if "error" in row] == ["poison"]


def test_chunks_that_are_done_are_held_by_nobody(workers) -> None:
    """Else a run grows by its inputs: Dask keeps what it sent last, for whoever looks for faults in it."""
    recipe, count, most = Recipe(SolveOptions()), 200, 0
    gc.freeze()  # what other tests have left is looked through ten times otherwise
    chunks = (Chunk((Item(f"held {k}", "", 0),), ("",), recipe) for k in range(count))
    for done, _ in enumerate(on_cluster(workers, chunks, ends_for_poison, told_as_lost), 1):
        if done % 20 == 0:
            gc.collect()
            most = max(most, sum(type(one) is Item and one.url.startswith("held") for one in gc.get_objects()))
    assert done == count
    assert most <= 4 * WAITING * 2  # those in hand, and what Dask is about to let go


def test_a_scheduler_of_somebody_elses_is_used(tmp_path, capsys) -> None:
    write_lists(tmp_path / "lists.parquet")
    file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    made = "from distributed.cli import dask_scheduler, dask_worker\nimport sys\n"
    command = [sys.executable, "-c", made + "sys.exit(getattr(globals()[sys.argv.pop(1)], 'main')())"]
    there = [
        subprocess.Popen(
            [*command, "dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", file], **quiet
        ),
        subprocess.Popen(
            [*command, "dask_worker", "--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--scheduler-file", file],
            **quiet,
        ),
    ]
    try:
        until = time.monotonic() + 60
        while not file.exists() and time.monotonic() < until:
            time.sleep(0.05)
        told = archive(capsys, tmp_path / "lists.parquet", "--out", tmp_path / "out", "--dask", file)
    finally:
        for process in there:
            process.terminate()
        for process in there:
            process.wait(30)
    assert told["solved"] == len(CENTRES)
    assert json.loads((tmp_path / "out" / "_kochab" / "run-all.json").read_text())["workers"] == str(file)


def test_an_outcome_that_goes_with_its_worker_is_waited_for_while_workers_are_kept() -> None:
    """All workers may end between the end of a chunk and the fetching of its rows: nobody else would start one."""
    kept, answers = [], [TimeoutError, UnboundLocalError, Outcome("", [])]

    def result(timeout):
        answer = answers.pop(0)
        if isinstance(answer, type):
            raise answer
        return answer

    future = SimpleNamespace(status="pending", result=result)
    workers = SimpleNamespace(keep=lambda: kept.append(1))
    assert _result(future, workers) == Outcome("", [])
    assert len(kept) == 2
    answers[:], future.status = [TimeoutError], "error"  # of the work itself
    with pytest.raises(TimeoutError):
        _result(future, workers)


def test_a_worker_that_stays_away_is_replaced_and_a_run_without_any_ends(monkeypatch) -> None:
    """Dask has ten seconds to start it again; a spare that does not come either is followed by another."""
    there, asked = {"one": 1}, []
    here = SimpleNamespace(worker_spec={"one": 0, "two": 0}, scale=asked.append)
    workers, began_s = Workers(SimpleNamespace(nthreads=lambda: there), here, 2), time.monotonic()

    def look_at(*times_s: float) -> list[int]:
        asked.clear()
        for after_s in times_s:
            monkeypatch.setattr(cluster_module, "time", SimpleNamespace(monotonic=lambda now=began_s + after_s: now))
            workers.keep()
        return list(asked)

    assert look_at(2.0, 9.0) == []
    assert look_at(11.0, 19.0) == [3]
    assert look_at(21.0) == [3]
    there["two"] = 1
    assert look_at(23.0) == []
    there.clear()
    assert look_at(30.0, 34.0, 322.0) == [4, 4]
    with pytest.raises(UsageError, match="none could be started again"):
        look_at(324.0)
