"""INDI's own server with its camera simulator, in a network of our own."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from kochab.core.errors import PortError
from kochab.gear.cameras import list_devices

from .own_network import own_network

ADDRESS = "localhost:7624"
REPOSITORY = Path(__file__).resolve().parents[3]

GSC = """
import sys
from pathlib import Path
import numpy as np
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.sky import open_catalogue

ra, dec, radius_arcmin = (float(sys.argv[k]) for k in (2, 3, 5))
Path(__file__).with_name("asked").write_text(f"{ra} {dec}")
catalogue = open_catalogue()
rows = catalogue.brightest(unit_vectors(ra, dec), np.radians(radius_arcmin / 60), 1500, 2026.9)
for k, (v, mag) in enumerate(zip(catalogue.vectors(rows, 2026.9), catalogue.mag(rows))):
    ra, dec = radec_deg(v)
    print(f"{k:010d} {ra:.5f} {dec:+.5f} 0.2 {mag:.2f} 0.3 0 0 0000 AA 0.0 0")
"""
"""Stands for the Guide Star Catalogue's program, which the camera simulator asks for its stars."""


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

    def __init__(self, home, stars=False):
        self.home = home
        self.path = os.environ["PATH"]
        if stars:
            script = home / "gsc"
            script.write_text(f"#!{sys.executable}\n{GSC}")
            script.chmod(0o755)
            self.path = f"{home}{os.pathsep}{self.path}"
        self.process = None

    def start(self):
        env = {
            **os.environ,
            "HOME": str(self.home),
            "PATH": self.path,
            "PYTHONPATH": os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")]),
        }
        self.process = subprocess.Popen(
            ["indiserver", "-p", "7624", "indi_simulator_ccd", "indi_simulator_telescope"],
            env=env,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        deadline = time.monotonic() + 90.0
        while time.monotonic() < deadline:
            try:
                if list_devices("indi", ADDRESS):
                    assert self.process.poll() is None, "another server has the port"
                    return
            except PortError:
                time.sleep(0.05)
        raise AssertionError("indiserver does not start")

    def driver(self):
        """The process of the camera's driver."""
        found = subprocess.run(
            ["pgrep", "-P", str(self.process.pid), "-f", "indi_simulator_ccd"], capture_output=True, text=True
        )
        return int(found.stdout.split()[0])

    def end(self):
        if self.process is not None and self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(20)
