"""The journal keeps every byte, motion, solve and fault, and its report gives nobody away."""

import json
import logging
import os
import platform
import re
import signal
import subprocess
import sys
import threading
import zipfile
from pathlib import Path

import pytest

from kochab.core.frame import Site
from kochab.gear import journal
from kochab.gear.journal import FILE, open_journal, save_report, versions
from kochab.gear.mounts.protocols import ioptron, lx200, nexstar
from tests.gear.mounts.bench import simulated
from tests.gear.mounts.test_conformance import wait_for


@pytest.fixture
def opened(tmp_path):
    """A journal in a folder of its own; logging and the hooks are as before afterwards."""
    root, hooks = logging.getLogger("kochab"), (sys.excepthook, threading.excepthook, sys.unraisablehook)
    handlers, level = list(root.handlers), root.level
    path = open_journal(tmp_path)
    yield path
    for handler in [h for h in root.handlers if h not in handlers]:
        root.removeHandler(handler)
        handler.close()
    root.setLevel(level)
    sys.excepthook, threading.excepthook, sys.unraisablehook = hooks


def sent_in(path):
    """Every byte that the journal says was sent, in order."""
    found = re.findall(r"serial_line \S+ > (b'.*'|b\".*\")$", path.read_text("utf-8"), re.MULTILINE)
    return b"".join(eval(data) for data in found)


SLEWS = """
import sys, pathlib
from kochab.core.progress import run
from kochab.gear.journal import open_journal
from kochab.gear.mounts.guard import Guard
from tests.gear.mounts.bench import LIMITS, SITE, Night, opened, place

port, driver, folder = sys.argv[1:]
open_journal(pathlib.Path(folder))
clock = Night()
guard = Guard(opened(driver, port, clock), SITE, LIMITS, clock=clock)
run(guard.slew(*place(-60.0, 50.0, clock)))
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
@pytest.mark.parametrize("driver", ["lx200", "nexstar", "skywatcher"])
def test_a_kill_in_the_middle_of_a_slew_leaves_every_byte_sent_on_disk(driver, tmp_path, repository) -> None:
    with simulated(driver, slew_deg_s=0.5) as bench:
        child = subprocess.Popen([sys.executable, "-c", SLEWS, bench.port, driver, tmp_path], cwd=repository)
        try:
            wait_for(lambda: bench.telescope.slewing, 60.0)
            polls = len(bench.line.transcript)
            wait_for(lambda: len(bench.line.transcript) > polls + 6)
        finally:
            child.send_signal(signal.SIGKILL)
            child.wait()
        assert child.returncode == -signal.SIGKILL
        received = b"".join(data for way, data in bench.line.transcript if way == "<")
    written = sent_in(tmp_path / FILE)
    assert len(received) > 30
    assert received in written
    assert len(written) - len(received) <= 24, "at most one command was written and not yet sent"
    assert "goto sent" in (tmp_path / FILE).read_text("utf-8")


def test_the_command_line_keeps_versions_and_bytes_both_ways(tmp_path, repository) -> None:
    with simulated("nexstar") as bench:
        command = [sys.executable, "-m", "kochab", "mount", "position", "--driver", "nexstar"]
        ran = subprocess.run(
            [*command, "--port", bench.port],
            cwd=repository,
            env={**os.environ, **dict.fromkeys(("XDG_STATE_HOME", "WIN_PD_OVERRIDE_LOCAL_APPDATA"), str(tmp_path))},
            capture_output=True,
            text=True,
            timeout=100,
        )
    assert ran.returncode == 0, ran.stderr
    text = next(tmp_path.rglob(FILE)).read_text("utf-8")
    assert f"Kochab {versions()['Kochab']}, Python {platform.python_version()}" in text
    assert f"{bench.port} > b'e'" in text
    assert re.search(rf"^\S+Z DEBUG \S+serial_line {bench.port} < b'[0-9A-F]{{8}},[0-9A-F]{{8}}#'$", text, re.M)


def test_a_command_does_not_ask_for_the_versions_of_packages(tmp_path, repository) -> None:
    """Reading the metadata of five packages, and the email package that it takes, delayed the start of each."""
    code = (
        "import sys, pathlib\n"
        "from kochab.gear.journal import open_journal\n"
        "open_journal(pathlib.Path(sys.argv[1]), terminal=bool(sys.argv[2]))\n"
        "print({'importlib.metadata', 'email'} & set(sys.modules))\n"
    )
    for terminal in ("yes", ""):
        ran = subprocess.run(
            [sys.executable, "-c", code, tmp_path / f"of{terminal}", terminal],
            cwd=repository,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert (ran.stdout.strip() == "set()") is bool(terminal), ran.stderr
        text = (tmp_path / f"of{terminal}" / FILE).read_text("utf-8")
        assert f"started: Kochab {versions()['Kochab']}, Python {platform.python_version()}, system" in text
        assert ("numpy" in text) is not bool(terminal)


def test_a_fault_that_nobody_catches_is_there_with_its_traceback(tmp_path, repository) -> None:
    code = (
        "import sys, threading, pathlib\n"
        "from kochab.gear.journal import open_journal\n"
        "open_journal(pathlib.Path(sys.argv[1]))\n"
        "def in_thread(): {}['key of the thread']\n"
        "thread = threading.Thread(target=in_thread, name='worker'); thread.start(); thread.join()\n"
        "def in_main(): raise ZeroDivisionError('of main')\n"
        "in_main()\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, tmp_path], cwd=repository, capture_output=True, text=True, timeout=60
    )
    assert "ZeroDivisionError: of main" in ran.stderr, "the terminal is told as before"
    text = (tmp_path / FILE).read_text("utf-8")
    for words in ("thread worker", "in in_thread", "KeyError: 'key of the thread'", "in in_main", "of main"):
        assert words in text


def test_it_rotates_and_keeps_five_files(tmp_path, monkeypatch, request) -> None:
    monkeypatch.setattr(journal, "FILE_BYTES", 2000)
    request.getfixturevalue("opened")
    for n in range(200):
        logging.getLogger("kochab.test").info("line %d %s", n, "x" * 100)
    assert len(list(tmp_path.glob(f"{FILE}*"))) == 5
    assert "line 199" in (tmp_path / FILE).read_text("utf-8")


def test_a_folder_that_cannot_be_written_is_no_fault(tmp_path) -> None:
    (tmp_path / "file").touch()
    assert open_journal(tmp_path / "file" / "folder") is None


def test_a_report_holds_no_secret(opened, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: Path("/home/ann"))
    monkeypatch.setenv("USERNAME", "ann")
    wire = logging.getLogger("kochab.gear.mounts.serial_line")
    wire.debug("%s > %r", "/dev/ttyUSB0", b":Gt#")
    wire.debug("%s < %r", "/dev/ttyUSB0", b"+48*08#")
    for question in (lx200.ALTITUDE, lx200.AZIMUTH, nexstar.ALTAZ_PRECISE, nexstar.ALTAZ_COARSE, ioptron.ALTAZ):
        wire.debug("%s > %r", "/dev/ttyUSB0", question)
        wire.debug("%s < %r", "/dev/ttyUSB0", b"+61*23#")
    here = Site(48.1372, 11.5755)
    for command in (*lx200.set_site(here), *ioptron.set_site(here), nexstar.set_site(here), b"W'''''''''"):
        wire.debug("%s > %r", "/dev/ttyUSB0", command)
        wire.debug("%s: %r was not sent, a Stop came first", "/dev/ttyUSB0", command)
    wire.debug("%s > %r", "/dev/ttyUSB0", b":SL12:34:56#")
    wire.debug("%s < %r", "/dev/ttyUSB0", b"W120#")
    wire.debug("%s > %r", "/dev/ttyUSB0", b":GR#")
    wire.debug("%s < %r", "/dev/ttyUSB0", b"05:30.0#")
    log = logging.getLogger("kochab.test")
    log.info("opening /home/ann/Pictures/m42.fits and /media/ann/Card of Ann/x.cr2")
    log.info("camera http://ann:hunter2@192.168.1.5:11111/camera, site_latitude=48.1372")
    try:
        raise ZeroDivisionError("of the report")
    except ZeroDivisionError:
        log.exception("fault")
    settings = {"site": "48.1372,11.5755", "indi/password": "hunter2", "camera": "indi://ann:hunter2@rig/CCD"}
    save_report(tmp_path / "report.zip", settings, opened.parent)
    with zipfile.ZipFile(tmp_path / "report.zip") as report:
        names = report.namelist()
        text = "".join(report.read(name).decode("utf-8") for name in names)
        assert json.loads(report.read("versions.json")) == versions()
    assert {"versions.json", "settings.json", FILE} <= set(names)
    site = ("48*08", "61*23", ":St", ":Sg", ":SLA", ":SLO", "W0", "''")
    for secret in ("hunter2", "ann", "Ann", ".1372", ".5755", *site, "Pictures", "/media"):
        assert secret not in text, secret
    assert '"site": "48,11"' in text
    wired = ("/dev/ttyUSB0 > b':GR#'", "b'05:30.0#'", ":SL12:34:56#", "W120#")
    for kept in ("m42.fits", *wired, "ZeroDivisionError", "test_journal.py"):
        assert kept in text, kept


def test_a_report_leaves_the_site_out_after_a_stop_and_in_the_next_file(tmp_path) -> None:
    """A Stop may be sent before the reply comes, and the file may rotate there."""
    older = ["> b':Gt#'", "> b':Q#'", "< b'+48*08#'", "> b':GR#'", "< b'05:30.0#'", "> b':Gg#'"]
    newer = ["< b'-11*35#'", "> b':GD#'", "< b'-05*23#'"]
    for name, lines in ((f"{FILE}.1", older), (FILE, newer)):
        text = "".join(f"2026-01-01 DEBUG kochab.serial_line /dev/ttyUSB0 {line}\n" for line in lines)
        (tmp_path / name).write_text(text, "utf-8")
    save_report(tmp_path / "report.zip", folder=tmp_path)
    with zipfile.ZipFile(tmp_path / "report.zip") as report:
        text = report.read(f"{FILE}.1").decode() + report.read(FILE).decode()
    assert "48*08" not in text
    assert "11*35" not in text
    for kept in ("05:30.0", "-05*23", "b':Q#'"):
        assert kept in text, kept
