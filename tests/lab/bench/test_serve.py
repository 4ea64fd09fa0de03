"""The bench of whole commands: what it counts and what it makes of it."""

import math
import os
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from PIL import Image

from kochab.lab.bench import Only, serve
from kochab.lab.bench.serve import Spent, compared, goals, rendered, spent


def test_a_command_is_timed_from_outside(tmp_path) -> None:
    busy = "import time; start = time.process_time()\nwhile time.process_time() - start < 0.3: pass"
    done = spent([sys.executable, "-c", busy])
    if os.name == "nt":
        assert math.isnan(done.cpu_s)  # Windows keeps no account of children
    else:
        assert 0.3 <= done.cpu_s < 5
        assert done.wall_s >= done.cpu_s * 0.5
    assert done.solved
    assert not spent([sys.executable, "-c", "raise SystemExit(1)"]).solved
    mark = tmp_path / "mark"
    assert not spent([sys.executable, "-c", ""], mark).solved
    assert spent([sys.executable, "-c", f"open({str(mark)!r}, 'w')"], mark).solved


def test_a_command_that_never_ends_is_ended(monkeypatch) -> None:
    monkeypatch.setattr(serve, "LIMIT_S", 0.5)
    assert not spent([sys.executable, "-c", "import time; time.sleep(600)"]).solved


def test_commands_have_turns_and_others_run_once() -> None:
    order = []

    def command(name, seconds):
        def run():
            order.append(name)
            return Spent(next(seconds), 1.0, True)

        return run

    found = {"kochab cold": command("cold", iter([9, 4, 2, 3])), "solve-field": command("field", iter([7, 0]))}
    rows = compared("x", found, 3)
    assert order == ["cold", "field", "cold", "cold", "cold"]
    assert [(row["wall_s"], row["least_wall_s"], row["of"]) for row in rows] == [(3, 2, 3), (7, 7, 1)]


def test_goals_are_measured_or_said_not_to_be() -> None:
    rows = [
        {"frame": "1.5 MP", "command": "kochab cold", "wall_s": 1.0, "cpu_s": 0.5},
        {"frame": "1.5 MP", "command": "kochab warm", "wall_s": 0.15, "cpu_s": 0.1},
        {"frame": "1.5 MP", "command": "kochab before", "wall_s": 2.0, "cpu_s": 2.0},
        {"frame": "61 MP", "command": "kochab warm", "wall_s": 0.4},
        {"frame": "b", "command": "--workers 1", "busy": 0, "wall_s": 2.0, "frames_cpu_s": 9.0},
        {"frame": "b", "command": "--workers 2", "busy": 0, "wall_s": 1.25, "frames_cpu_s": 8.0},
        {"frame": "b, busy", "command": "--workers 1", "busy": 4, "wall_s": 6.0, "frames_cpu_s": 7.0},
        {"frame": "b, busy", "command": "--workers 2", "busy": 4, "wall_s": 5.0, "frames_cpu_s": 7.0},
        {"frame": "b", "command": serve.APART, "busy": 0, "wall_s": 1.0, "frames_cpu_s": 8.0},
    ]
    expected = [0.25, 0.075, 0.4, 9.0, 1.6, 2.0, 1.2]
    assert [goal.value for goal in goals(rows)] == expected
    assert [goal.value for goal in goals(rows) if not goal.met] == [0.4, 1.6]
    assert [goal.met for goal in goals(rows[:1])] == [None] * len(expected)


def test_rows_are_measured_alone_and_with_everybodys_variables(monkeypatch) -> None:
    """A batch needs an idle machine for a minute, all rows for a quarter of an hour."""
    asked = []
    for name in serve.LEFT_OUT:
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(serve, "_worker", lambda folder: nullcontext())
    monkeypatch.setattr(serve, "rendered", lambda file, *shape: file)
    monkeypatch.setattr(serve, "batch", lambda files, busy: asked.append((busy, dict(os.environ))) or [])
    serve.run(True, lambda line: None, Only(("batch",)))
    serve.run(True, lambda line: None, Only(("batch beside",)))
    assert [busy for busy, _ in asked] == [0, serve.BUSY, serve.BUSY]
    assert not any(name in variables for _, variables in asked for name in serve.LEFT_OUT)
    assert all(os.environ[name] == "1" for name in serve.LEFT_OUT)


def test_a_batch_has_its_turns_and_leaves_no_loop_behind(tmp_path, monkeypatch) -> None:
    asked, loops = [], []

    def spent(command: list[str]) -> Spent:
        asked.append((command[-1], sum(word.endswith(".fits") for word in command)))
        return Spent(len(asked), 1.0, True)

    monkeypatch.setattr(serve, "spent", spent)
    popen = serve.subprocess.Popen
    monkeypatch.setattr(serve.subprocess, "Popen", lambda command: loops.append(popen(command)) or loops[-1])
    one, two, apart = serve.batch([tmp_path / "a.fits"] * 4, 1)
    assert asked == [("1", 4), ("2", 4), ("1", 2), ("1", 2)] * serve.BATCH_TURNS
    assert (one["wall_s"], two["wall_s"], apart["wall_s"], one["frames_s"]) == (9, 10, 12, 4 / 9)
    assert [loop.returncode is not None for loop in loops] == [True]


def test_a_picture_of_a_frame_keeps_its_stars(tmp_path) -> None:
    file = rendered(tmp_path / "a.fits", 600, 400, 15.0)
    with Image.open(serve._png(file)) as image:
        shown = np.asarray(image)
    assert (shown.shape, shown.dtype) == ((400, 600), np.uint8)
    assert 5 < np.median(shown) < 60
    assert (shown == 255).sum() > 20


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the worker is for Linux")
def test_a_small_frame_is_solved_cold_and_warm(tmp_path, monkeypatch) -> None:
    file = rendered(tmp_path / "a.fits", 600, 400, 15.0)
    with serve._worker(tmp_path) as worker:
        made = serve.commands(file, 15.0, worker)
        rows = compared("a", {name: made[name] for name in ("kochab cold", "kochab warm")}, 1)
    assert [row["solved"] for row in rows] == [1, 1]
    assert rows[1]["cpu_s"] > 0.02  # the worker's child is counted
