"""The process that makes the patterns for small fields, with something quick in its place."""

import os
import signal
import time
from multiprocessing import active_children, get_context

import pytest

from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress
from kochab.workflows import fine_patterns
from tests.window import makers


@pytest.fixture
def elsewhere(monkeypatch):
    """What is done in the real process in place of making patterns."""
    return lambda make: monkeypatch.setattr(fine_patterns, "make_here", make)


def test_progress_is_passed_on_to_the_end(elsewhere):
    elsewhere(makers.a_quarter)
    seen = list(fine_patterns.make_elsewhere())
    assert Progress("patterns", 0.25) in seen


def test_why_it_went_wrong_is_told(elsewhere):
    elsewhere(makers.full_disk)
    with pytest.raises(CatalogueError, match="The disk is full"):
        list(fine_patterns.make_elsewhere())


def test_a_process_that_dies_is_one_sentence(elsewhere):
    elsewhere(makers.dead)
    with pytest.raises(CatalogueError, match="Can't build the small-field index"):
        list(fine_patterns.make_elsewhere())


def test_closing_the_task_ends_the_process(elsewhere):
    elsewhere(makers.endless)
    task = fine_patterns.make_elsewhere()
    next(task)
    assert active_children()
    task.close()
    assert not active_children()


def test_a_process_that_does_not_listen_is_ended_soon_and_leaves_nothing(tmp_path, monkeypatch, elsewhere):
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path / "cache"))
    elsewhere(makers.deaf)
    task = fine_patterns.make_elsewhere()
    while next(task).fraction != 0.5:
        pass
    assert {path.suffix for path in (tmp_path / "cache").iterdir()} == {".lock", ".part"}
    asked = time.monotonic()
    task.close()
    assert time.monotonic() - asked < 2.0
    assert not active_children()
    assert list((tmp_path / "cache").iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="Windows ends a process without asking it")
def test_an_ended_process_leaves_its_step_without_an_exception(tmp_path):
    """SciPy's threads went on in arrays that were gone then, and crashed."""
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=makers.within_a_step, args=(theirs, tmp_path))
    process.start()
    assert ours.recv().fraction == 0.5
    process.terminate()
    process.join(60.0)
    assert process.exitcode == -signal.SIGTERM
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="Windows ends a process without asking it")
def test_an_ended_process_leaves_nothing_half_made(tmp_path, monkeypatch, capfd, elsewhere):
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path / "cache"))
    elsewhere(makers.of_bright_stars)
    task = fine_patterns.make_elsewhere()
    while not next(task).fraction:
        pass
    assert list(tmp_path.rglob("*.part"))
    task.close()
    assert not [p for p in tmp_path.rglob("*") if p.suffix in (".lock", ".part")]
    assert "Traceback" not in capfd.readouterr().err
