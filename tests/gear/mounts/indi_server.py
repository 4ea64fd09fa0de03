"""INDI's own server with drivers of telescopes, in a network of our own."""

import os
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager

import pytest

from tests.gear.cameras.indi_server import indi_network


class IndiServer:
    """One indiserver, set up by INDI's own command line."""

    address = "localhost:7624"

    def __init__(self, home, *drivers):
        self.process = subprocess.Popen(
            ["indiserver", "-p", "7624", *drivers],
            env={**os.environ, "HOME": str(home)},
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def set(self, *properties):
        """``device.vector.member=value``, each when the driver has told of it."""
        for wanted in properties:
            deadline = time.monotonic() + 90.0
            while subprocess.run(["indi_setprop", "-t", "2", wanted], capture_output=True).returncode:
                assert time.monotonic() < deadline, f"no {wanted}"
                time.sleep(0.1)

    def get(self, name):
        """What INDI's own client reads."""
        (value,) = self.get_all(name)
        return value

    def get_all(self, *names):
        """The same of several at once, in their order; "" for what it does not tell."""
        told = subprocess.run(["indi_getprop", "-t", "20", *names], capture_output=True, text=True)
        values = dict(line.split("=", 1) for line in told.stdout.splitlines() if "=" in line)
        return [values.get(name, "").strip() for name in names]

    def end(self):
        """With all its drivers."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(20)


@contextmanager
def indi_server(home, *drivers):
    """The server with its drivers; skipped where one of them is not installed."""
    for driver in drivers:
        if shutil.which(driver) is None:
            packages = "indi-bin indi-eqmod indi-avalon indi-starbook indi-bresserexos2"
            pytest.skip(f"{driver} is not there: apt-get install {packages}")
    with indi_network():
        server = IndiServer(home, *drivers)
        try:
            yield server
        finally:
            server.end()
