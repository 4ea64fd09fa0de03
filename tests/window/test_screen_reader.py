"""A whole solve and every mode by a screen reader's own way, AT-SPI, from a process of the system's Python."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.window.test_screen import REPOSITORY, environment, screen  # noqa: F401  (fixtures)

READER = Path(__file__).with_name("atspi_reader.py")
SYSTEM = shutil.which("python3", path="/usr/bin:/bin")
BOTH = 'cd "$0"; "$1" -m kochab >&2 & "$2" -W ignore "$3"; told=$?; kill $!; exit $told'


def absent():
    """What AT-SPI needs and this system has not."""
    if SYSTEM is None or shutil.which("dbus-run-session") is None:
        return "dbus-run-session"
    asked = "import gi; gi.require_version('Atspi', '2.0'); from gi.repository import Atspi"
    return subprocess.run([SYSTEM, "-c", asked], capture_output=True).returncode and "gir1.2-atspi-2.0 and python3-gi"


CRASH = "Fatal Python error"  # of any process: the window's, or one that it has started


def read_aloud(environment):  # noqa: F811
    command = ["dbus-run-session", "--", "sh", "-c", BOTH, str(REPOSITORY), sys.executable, SYSTEM, str(READER)]
    own = {"QT_LINUX_ACCESSIBILITY_ALWAYS_ON": "1", "PYTHONPATH": str(REPOSITORY / "app"), "PYTHONFAULTHANDLER": "1"}
    try:
        return subprocess.run(command, env=environment | own, capture_output=True, text=True, timeout=570)
    except subprocess.TimeoutExpired as late:  # a reader may wait long for a window that is gone
        stderr = (late.stderr or b"").decode("utf-8", "replace")
        return subprocess.CompletedProcess(command, 1, "", f"{stderr}\nIt took more than {late.timeout:g} s.")


@pytest.mark.timeout(600)
def test_a_screen_reader_solves_and_finds_a_name_for_every_control(environment):  # noqa: F811
    if missing := absent():
        pytest.skip(f"a screen reader needs {missing}")
    done = read_aloud(environment)
    assert done.returncode == 0, done.stderr[-8000:]
    assert CRASH not in done.stderr, done.stderr[-8000:]  # where every thread was
    report = json.loads(done.stdout[done.stdout.index("{") :])  # after what the bus says of itself
    ra, dec = report["pointing"][:2]
    assert ra.startswith("05h 3")
    assert dec.startswith("−0")
    assert set(report["nameless"]) == {"welcome", "image", "Live", "Mount", "Polar alignment", "Laboratory"}
    assert not any(report["nameless"].values()), report["nameless"]
