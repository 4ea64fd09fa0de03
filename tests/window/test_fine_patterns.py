"""The process that makes the patterns for small fields, with something quick in their place."""

import os
import subprocess
import sys
import time

import pytest

from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress
from kochab.workflows import fine_patterns


@pytest.fixture
def elsewhere(monkeypatch, repository):
    """Runs ``code`` in place of the module, in a real process."""
    started = []
    popen = subprocess.Popen

    def use(code):
        def start(arguments, **options):
            process = popen([sys.executable, "-c", code, arguments[-1]], **options)
            started.append(process)
            return process

        monkeypatch.setattr(fine_patterns.subprocess, "Popen", start)
        return started

    return use


TELL = "import sys, time, pathlib; tell = pathlib.Path(sys.argv[1]).write_text; "


def test_progress_is_passed_on_to_the_end(elsewhere):
    elsewhere(TELL + "tell('{\"fraction\": 0.25}'); time.sleep(0.7)")
    seen = list(fine_patterns.make_elsewhere())
    assert Progress("patterns", 0.25) in seen


def test_why_it_went_wrong_is_told(elsewhere):
    elsewhere(TELL + 'tell(\'{"error": "The disk is full."}\'); sys.exit(1)')
    with pytest.raises(CatalogueError, match="The disk is full"):
        list(fine_patterns.make_elsewhere())


def test_a_process_that_dies_is_one_sentence(elsewhere):
    elsewhere("import os; os._exit(3)")
    with pytest.raises(CatalogueError, match="Can't build the small-field index"):
        list(fine_patterns.make_elsewhere())


def test_closing_the_task_ends_the_process(elsewhere):
    started = elsewhere("import time; time.sleep(60)")
    task = fine_patterns.make_elsewhere()
    next(task)
    task.close()
    assert started[0].poll() is not None


@pytest.mark.skipif(os.name != "posix", reason="Windows ends a process without asking it")
def test_an_ended_process_leaves_nothing_half_made(tmp_path, repository):
    environment = os.environ | {"KOCHAB_CACHE": str(tmp_path / "cache")}
    told = tmp_path / "progress.json"
    process = subprocess.Popen(
        [sys.executable, "-m", "kochab.workflows.fine_patterns", str(told)],
        cwd=repository,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while not told.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    process.terminate()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1, err
    assert "Traceback" not in err
    left = [p for p in tmp_path.rglob("*") if p.suffix in (".lock", ".part")]
    assert left == []
