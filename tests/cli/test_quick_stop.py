"""``kochab mount stop`` has Stop on the line before it has imported what the rest of it needs."""

import os
import subprocess
import sys
import time

import pytest

from kochab.gear import quick_stop
from kochab.gear.mounts import DRIVERS, SERVERS
from kochab.gear.profiles import EquipmentProfile, save_profile

pty, tty = (pytest.importorskip(name) for name in ("pty", "tty"))  # Windows has none

FIRST_OPEN = """
import sys, serial
def opened(port, baudrate, **more):
    heavy = {'numpy', 'erfa', 'logging', 'argparse', 'zipfile', 'kochab.gear.mounts'} & set(sys.modules)
    print(port, baudrate, sorted(heavy))
    raise SystemExit(0)
serial.serial_for_url = opened
from kochab.__main__ import main
main(sys.argv[1:])
"""


@pytest.fixture
def terminal():
    """A pseudo-terminal: the end that a mount would read, and its port."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for end in (master, slave):
        os.close(end)


def test_its_table_is_that_of_the_drivers() -> None:
    lines = {name: driver for name, driver in DRIVERS.loaded().items() if name not in SERVERS}
    assert {name: (driver.bauds[0], driver.blind_stop) for name, driver in lines.items()} == quick_stop.STOPS


@pytest.mark.parametrize("driver", quick_stop.STOPS)
def test_the_bytes_of_each_driver_go_out(terminal, driver) -> None:
    master, port = terminal
    quick_stop.send_first_stop(["mount", "stop", f"--port={port}", "--driver", driver])
    assert os.read(master, 64) == quick_stop.STOPS[driver][1]


def test_port_driver_and_baud_come_from_the_profile_and_what_is_typed_goes_before_it(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    save_profile(EquipmentProfile("Newton", port="/dev/no", driver="ioptron", baud=230400))
    for typed, expected in (([], "/dev/no 230400 []"), (["--port", "/dev/other", "--baud=9600"], "/dev/other 9600 []")):
        command = [sys.executable, "-c", FIRST_OPEN, "mount", "stop", "--profile", "Newton", *typed]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert ran.stdout.strip() == expected, ran.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--port", "/dev/null"],
        ["--driver", "lx200"],
        ["--port", "/no/such/port", "--driver", "lx200"],
        ["--port", "x", "--driver", "none"],
        ["--port", "x", "--driver", "lx200", "--baud", "fast"],
        ["--profile", "none"],
        ["--profile", " "],
        ["--profile"],
        ["--port", "udp://127.0.0.1:1", "--driver", "skywatcher"],
    ],
)
def test_without_a_port_and_a_driver_it_is_left_to_the_command(arguments, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    quick_stop.send_first_stop(["mount", "stop", *arguments])


def test_a_damaged_profile_is_left_to_the_command(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    path = save_profile(EquipmentProfile("Newton"))
    for text in ("", "[]", '{"port": 3, "driver": []}', "\xff"):
        path.write_text(text, "latin-1")
        quick_stop.send_first_stop(["mount", "stop", "--profile", "Newton"])


def test_the_program_itself_sends_it_first(terminal) -> None:
    """How soon, is told here; a busy machine must not fail a test: it is well before the program ends."""
    master, port = terminal
    begun = time.monotonic()
    ran = subprocess.Popen(
        [sys.executable, "-m", "kochab", "mount", "stop", "--port", port, "--driver", "lx200"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert os.read(master, 4) == b"#:Q#"
    first_s = time.monotonic() - begun
    again = os.read(master, 4)
    assert again == b"#:Q#", "the command sends it again"
    again_s = time.monotonic() - begun
    ran.communicate(timeout=60)
    print(f"first byte {1000 * first_s:.0f} ms, the command's own {1000 * again_s:.0f} ms")
    assert first_s < again_s
