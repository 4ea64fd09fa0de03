"""The real window with the real engine on a virtual X screen, and the entry point that opens it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.virtual_screen import virtual_screen

REPOSITORY = Path(__file__).resolve().parents[2]
SAMPLES = REPOSITORY / "resources" / "samples"


@pytest.fixture(scope="module")
def screen():
    """The name of a virtual X screen made for these tests."""
    with virtual_screen() as display:
        yield display


@pytest.fixture
def environment(screen, tmp_path):
    kept = {k: v for k, v in os.environ.items() if k not in ("WAYLAND_DISPLAY", "QT_SCALE_FACTOR")}
    kept |= {"DISPLAY": screen, "QT_QPA_PLATFORM": "xcb", "PYTHONWARNINGS": "error"}
    kept["KOCHAB_CACHE"] = str(tmp_path / "CACHE")
    return kept | {f"XDG_{n}_HOME": str(tmp_path / n) for n in ("CONFIG", "CACHE", "DATA", "STATE")}


@pytest.mark.parametrize("scale", ["1", "2"])
def test_the_window_solves_a_sample_on_a_screen(environment, tmp_path, scale):
    done = subprocess.run(
        [sys.executable, "-m", "tests.window.take_screenshots", str(tmp_path), "--plain"],
        cwd=REPOSITORY,
        env=environment | {"QT_SCALE_FACTOR": scale},
        capture_output=True,
        text=True,
        timeout=110,
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["platform"] == "xcb"
    assert told["solved"], done.stderr
    assert told["ra_deg"] == pytest.approx(56.7, abs=1.0)
    assert told["dec_deg"] == pytest.approx(24.1, abs=1.0)
    day, night = (np.asarray(Image.open(tmp_path / n).convert("RGB")) for n in ("window.png", "night.png"))
    assert day.shape == (860 * int(scale), 1360 * int(scale), 3)
    assert not night[..., 1:].any()
    assert night[..., 0].max() == 255


def start(environment, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "app", *arguments],
        cwd=REPOSITORY,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    ("name", "arguments"), [("SIGINT", []), ("SIGINT", [str(SAMPLES / "orion.png")]), ("SIGTERM", []), ("SIGHUP", [])]
)
def test_what_ends_a_program_closes_the_window_cleanly(environment, tmp_path, name, arguments):
    """Cleanly: a window that is closed stops its mount."""
    number = getattr(signal, name)
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip(f"{name} is ignored here, as under nohup, and so by what is started here")
    program = start(environment, *arguments)
    settings = tmp_path / "CONFIG" / "kochab" / "window.ini"
    deadline = time.monotonic() + 60
    while not settings.exists() and program.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)  # the settings are first written when the event loop runs
    time.sleep(0.5)
    program.send_signal(number)
    out, err = program.communicate(timeout=40)
    assert program.returncode == 0, err
    assert "Traceback" not in err + out
    assert settings.exists()


def run_without_screen(tmp_path, **changes):
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")}
    return subprocess.run(
        [sys.executable, "-m", "app"], cwd=REPOSITORY, env=kept | changes, capture_output=True, text=True, timeout=60
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are named on Linux")
def test_no_screen_is_one_sentence_and_exit_2(tmp_path):
    done = run_without_screen(tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("kochab: No display found")
    assert len(done.stderr.strip().splitlines()) == 1
