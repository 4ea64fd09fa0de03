"""Batches: a fault costs one file, processes end quietly, progress keeps to stderr."""

import json
import logging
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from kochab.cli import output
from kochab.cli.batch import attempt, run_batch
from kochab.cli.main import main
from kochab.cli.output import ProgressLine
from kochab.core.progress import Progress, run
from tests.cli.batch_work import Item, work


def attempted(name):
    return attempt(name, lambda: run(work(Item(name))))


def test_a_fault_of_our_own_costs_one_file() -> None:
    assert attempted("bad") == {"file": "bad", "error": "It is bad."}
    fault = attempted("fault")
    assert fault["error"].startswith("A fault in Kochab: ZeroDivisionError: division by zero; ")
    assert "Out of memory" in attempted("large")["error"]


def test_a_sentence_names_its_file_once(capsys) -> None:
    assert run_batch(work, [Item("bad"), Item("cut.fits")], as_json=False) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "kochab: bad: It is bad.\nkochab: cut.fits is cut short.\n"


def test_the_code_is_the_worst(capsys) -> None:
    assert run_batch(work, [Item("a"), Item("b")], as_json=True) == 0
    assert run_batch(work, [Item("a"), Item("fault"), Item("b")], as_json=True) == 2
    assert len(capsys.readouterr().out.splitlines()) == 5


def test_a_process_that_dies_is_told(tmp_path, capsys) -> None:
    assert run_batch(work, [Item("a"), Item("b")], as_json=True, workers=2) == 0
    assert capsys.readouterr().out.count('"solved": true') == 2
    mark = tmp_path / "killed"
    assert run_batch(work, [Item(str(mark)), Item(str(mark))], as_json=True, workers=2) == 2
    assert capsys.readouterr().out.count("ended from outside") == 2
    run_batch(work, [Item(str(mark)), *map(Item, "abcdef")], as_json=True, workers=2)
    lines = capsys.readouterr().out.splitlines()
    assert ["outside" in line for line in lines] == [True] + 6 * [False]  # and costs no other file
    assert mark.exists()


def test_a_worker_s_fault_is_in_the_journal_with_its_traceback(tmp_path, capsys, monkeypatch) -> None:
    journal = logging.FileHandler(tmp_path / "journal.log")
    monkeypatch.setattr(logging.getLogger("kochab"), "handlers", [journal])  # whatever journal is open already
    assert run_batch(work, [Item("fault"), Item("a")], as_json=True, workers=2) == 2
    journal.close()
    assert str(tmp_path / "journal.log") in json.loads(capsys.readouterr().out.splitlines()[0])["error"]
    text = (tmp_path / "journal.log").read_text()
    assert "batch_work.py" in text  # the line in the worker, not the parent's
    assert text.count("ZeroDivisionError: division by zero") == 1


HOLD = """
import sys, time
from kochab.cli.batch import run_batch
from tests.cli.batch_work import Item, long_work

if __name__ == "__main__":
    run_batch(long_work, [Item(sys.argv[1])] * 2, True, 2)
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_batch_that_is_killed_leaves_no_process_behind(repository, tmp_path) -> None:
    script = tmp_path / "hold.py"
    script.write_text(HOLD)
    paths = os.pathsep.join([str(repository), *sys.path])
    batch = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "alive")],
        stdout=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": paths},
    )
    try:
        until(lambda: len(list(tmp_path.glob("alive.*"))) == 2)
    finally:
        batch.kill()
        batch.wait()
    workers = [int(path.suffix[1:]) for path in tmp_path.glob("alive.*")]
    until(lambda: not any(running(pid) for pid in workers))


LOADED = """
import sys
from kochab.cli.batch import run_batch
from tests.cli import batch_work
from tests.cli.batch_work import Item, what_is_loaded

if __name__ == "__main__":
    batch_work.loaded_before = "by the parent"
    run_batch(what_is_loaded, [Item("a"), Item("b")], True, 2)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forked on Linux alone")
def test_what_the_command_has_loaded_is_not_loaded_again_by_each_process(repository, tmp_path) -> None:
    script = tmp_path / "loaded.py"
    script.write_text(LOADED)
    paths = os.pathsep.join([str(repository), *sys.path])
    env = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=env)
    assert [json.loads(line)["loaded"] for line in done.stdout.splitlines()] == ["by the parent"] * 2, done.stderr


def running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")  # where nobody reaps, a dead process stays in the list
    return not (status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z")


def until(true) -> None:
    end = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_progress_rewrites_one_line_on_a_terminal(monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    line = ProgressLine("a.fits")
    line(Progress("detect"))
    line(Progress("identify", None, "blind"))
    line.clear()
    out, err = capsys.readouterr()
    assert out == ""
    assert "\n" not in err
    assert err.split("\r\x1b[K") == ["", "a.fits: detect", "a.fits: identify blind", ""]


@pytest.mark.parametrize(("seconds", "lines"), [(1.0, 0), (3.0, 1)])
def test_elsewhere_one_line_is_said_when_it_takes_long(monkeypatch, capsys, seconds, lines) -> None:
    now = [100.0]
    monkeypatch.setattr(output, "perf_counter", lambda: now[0])
    monkeypatch.setattr(output, "SOON_S", 2.0)
    line = ProgressLine("a.fits")
    line(Progress("detect"))
    now[0] += seconds
    line(Progress("identify"))
    line(Progress("identify"))
    line.clear()
    assert capsys.readouterr().err.count("\n") == lines


def test_processes_are_born_deaf_to_ctrl_c(monkeypatch, tmp_path, capsys) -> None:
    heard = []

    class Pool(ProcessPoolExecutor):
        def submit(self, *arguments):
            heard.append(signal.getsignal(signal.SIGINT))
            return super().submit(*arguments)

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", Pool)
    stars = tmp_path / "a.csv"
    stars.write_text("1,1\n2,2\n")
    size = ("--width", "9", "--height", "9")
    assert main(["identify", str(stars), str(stars), *size, "--json", "--workers", "2"]) == 1
    assert capsys.readouterr().out.count("too few stars") == 2
    assert heard == [signal.SIG_IGN, signal.SIG_IGN]
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.skipif(os.name == "nt", reason="SIGINT is sent to a process of POSIX")
def test_a_process_that_was_born_hearing_leaves_ctrl_c_to_its_parent() -> None:
    """As every process on Windows is, and one whose parent handles Ctrl-C itself."""
    told = "import os, signal; from kochab.cli.batch import _begin; signal.signal(signal.SIGINT, signal.SIG_DFL)"
    told += "; _begin(None); os.kill(os.getpid(), signal.SIGINT); print('at work')"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "at work\n", "")
