"""Debian's KStars on a virtual screen sees a practice mount through our INDI device and steers it, behind the guard.

Its own INDI client is asked and steered over D-Bus (``org.kde.kstars.INDI``), as its scripts do, in a home of its own.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from kochab.core.attitude import apart_deg
from tests.server.telescope.conftest import wait_for
from tests.virtual_screen import virtual_screen

PROGRAMS = {"kstars": "kstars", "Xvfb": "xvfb", "dbus-run-session": "dbus-daemon", "gdbus": "libglib2.0-bin"}
INDI = "org.kde.kstars.INDI"
SITE, PATIENCE_S = "48,11", 90.0
NO_WIZARD = "[StartupWizard]\nRunStartupWizard=false\n"
SESSION = 'echo "$DBUS_SESSION_BUS_ADDRESS"; exec kstars >/dev/null 2>&1'
BUS = """<busconfig><type>session</type><listen>unix:tmpdir=/tmp</listen><auth>EXTERNAL</auth>
<policy context="default"><allow send_destination="*" eavesdrop="true"/><allow eavesdrop="true"/><allow own="*"/></policy></busconfig>"""
"""A bus that starts no services: KStars would wait for a keyring that nobody unlocks."""


class KStars:
    """Its INDI client, called over D-Bus."""

    def __init__(self, bus):
        self._env = {**os.environ, "DBUS_SESSION_BUS_ADDRESS": bus}

    def __call__(self, method, *arguments):
        """Its answer as GVariant text, empty while there is none."""
        call = ["gdbus", "call", "--session", "--timeout", "20", "-d", "org.kde.kstars", "-o", "/KStars/INDI"]
        call += ["-m", f"{INDI}.{method}", "--", *map(str, arguments)]
        return subprocess.run(call, env=self._env, capture_output=True, text=True, timeout=60).stdout.strip()

    def number(self, name):
        return float(re.sub(r"[(),]", "", self("getNumber", "Kochab", "EQUATORIAL_EOD_COORD", name)))

    def place(self):
        """RA and Dec of date at which it shows the telescope, degrees."""
        return self.number("RA") * 15.0, self.number("DEC")

    def state(self):
        return self("getPropertyState", "Kochab", "EQUATORIAL_EOD_COORD")

    def goto(self, ra_deg, dec_deg):
        for name, value in (("RA", ra_deg / 15.0), ("DEC", dec_deg)):
            assert self("setNumber", "Kochab", "EQUATORIAL_EOD_COORD", name, value) == "(true,)"
        assert self("sendProperty", "Kochab", "EQUATORIAL_EOD_COORD") == "(true,)"


@contextmanager
def running(*command, **how):
    """The output of a program, which is ended afterwards with all that it has started."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True, **how) as process:
        try:
            yield process.stdout
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)


@pytest.fixture
def practice():
    """The port of an INDI device: a practice mount that other programs may move."""
    us = [sys.executable, "-m", "app"]
    with running(*us, "practice", "--socket", "--json", "--lost", "0", "--site", SITE, stdin=subprocess.PIPE) as night:
        mount = ["--port", json.loads(night.readline())["port"], "--driver", "lx200", "--site", SITE]
        mount += ["--trust-mount", "--yes"]  # its night is not this computer's
        with running(*us, "telescope", *mount, "--offer", "indi=0", "--json") as offered:
            events = (json.loads(line) for line in offered)
            yield next(event["ports"]["indi"] for event in events if event["event"] == "ready")


@pytest.fixture
def kstars():
    missing = [package for program, package in PROGRAMS.items() if shutil.which(program) is None]
    if missing:
        pytest.skip(f"KStars, or a program that drives it, is not installed: apt-get install {' '.join(missing)}")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as home:
        (Path(home) / ".config").mkdir()
        (Path(home) / ".config" / "kstarsrc").write_text(NO_WIZARD)
        (bus := Path(home) / "bus.conf").write_text(BUS)
        env = {**os.environ, "HOME": home, "XDG_RUNTIME_DIR": home, "LIBGL_ALWAYS_SOFTWARE": "1"}
        env |= {"XDG_CONFIG_HOME": f"{home}/.config", "QT_QPA_PLATFORM": "xcb"}
        session = ("dbus-run-session", f"--config-file={bus}", "--", "bash", "-c", SESSION)
        with (
            virtual_screen() as display,
            running(*session, env=env | {"DISPLAY": display}, stderr=subprocess.DEVNULL) as lines,
        ):
            program = KStars(lines.readline().strip())
            assert wait_for(lambda: program("getDevices") != "", PATIENCE_S)
            yield program


def test_kstars_shows_where_it_points_and_steers_it_behind_the_guard(kstars, practice) -> None:
    assert kstars("connect", "127.0.0.1", practice) == "(true,)"
    assert wait_for(lambda: "Kochab" in kstars("getDevices"), PATIENCE_S)
    assert kstars("setSwitch", "Kochab", "CONNECTION", "CONNECT", "On") == "(true,)"
    assert kstars("sendProperty", "Kochab", "CONNECTION") == "(true,)"
    assert wait_for(lambda: kstars.state() == "('Ok',)", PATIENCE_S)
    start = kstars.place()
    there = (start[0] + 4.0) % 360.0, start[1] + (3.0 if start[1] < 50.0 else -3.0)
    kstars.goto(*there)
    assert wait_for(lambda: apart_deg(kstars.place(), there) < 1.0 / 60.0 and kstars.state() == "('Ok',)", PATIENCE_S)
    kstars.goto(there[0], -80.0)  # never above the horizon there
    assert wait_for(lambda: kstars.state() == "('Alert',)", PATIENCE_S)
    assert apart_deg(kstars.place(), there) < 2.0 / 60.0
