"""INDI's own server with its camera simulator, in a network of our own."""

import os
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager

import pytest

from app.cameras import list_devices
from app.core.errors import PortError

from .own_network import own_network

ADDRESS = "localhost:7624"


@contextmanager
def indi_network():
    """A network of our own, or a skip that says what to install."""
    pytest.importorskip("indipyclient")
    if shutil.which("indiserver") is None or shutil.which("ip") is None:
        pytest.skip("needs INDI's server and ip: apt-get install indi-bin iproute2")
    with own_network():
        yield


class Server:
    """indiserver with the camera simulator, started and ended as often as a test likes."""

    def __init__(self, home):
        self.home = home
        self.process = None

    def start(self):
        env = {**os.environ, "HOME": str(self.home)}
        self.process = subprocess.Popen(
            ["indiserver", "-p", "7624", "indi_simulator_ccd", "indi_simulator_telescope"],
            env=env, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            try:
                if list_devices("indi", ADDRESS):
                    return
            except PortError:
                time.sleep(0.05)
        raise AssertionError("indiserver does not start")

    def driver(self):
        """The process of the camera's driver."""
        found = subprocess.run(
            ["pgrep", "-P", str(self.process.pid), "-f", "indi_simulator_ccd"],
            capture_output=True, text=True,
        )  # fmt: skip
        return int(found.stdout.split()[0])

    def end(self):
        if self.process is not None and self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(20)
