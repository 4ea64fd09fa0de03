"""Debian's Stellarium on a virtual screen, its view and selection by its plug-in Remote Control: ``python -m tests.server.telescope.stellarium_remote_on_screen FOLDER``.

Kochab solves a sample and turns Stellarium's view there; then Vega is selected in Stellarium, and is the target. What
Kochab says is printed, a picture of the screen goes into FOLDER; exit code 0 when view and target are right within 1'.
Takes a minute; needs Linux, root, xvfb and stellarium. Everything runs in a network of its own.
"""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from math import asin, atan2, degrees
from pathlib import Path
from urllib.parse import urlencode
from urllib.request import urlopen

from kochab.core.attitude import apart_deg
from tests.gear.cameras.own_network import own_network
from tests.server.telescope.conftest import wait_for
from tests.server.telescope.stellarium_on_screen import home_of

API, SAMPLE = "http://127.0.0.1:8090/api/", Path("resources/samples/orion.png")
REMOTE = {"plugins_load_at_startup": {"RemoteControl": "true"}, "RemoteControl": {"autostart": "true"}}


def ask(path, **form):
    """GET, or POST what is given; what it says."""
    with urlopen(API + path, urlencode(form).encode() if form else None, timeout=10) as answer:
        return answer.read()


def view_deg():
    """Where Stellarium looks, J2000."""
    x, y, z = json.loads(json.loads(ask("main/view"))["j2000"])
    return degrees(atan2(y, x)) % 360.0, degrees(asin(z))


def up():
    """Whether it answers by now."""
    with contextlib.suppress(OSError):
        return bool(ask("main/status"))
    return False


def main(pictures):
    """Run it; whether view and target were right."""
    pictures.mkdir(parents=True, exist_ok=True)
    us = [sys.executable, "-m", "app"]
    solved = json.loads(subprocess.run([*us, "solve", SAMPLE, "--json"], capture_output=True, check=True).stdout)
    place = solved["ra_deg"], solved["dec_deg"]
    with own_network(), tempfile.TemporaryDirectory() as home:
        frames = Path(home) / "frames"
        frames.mkdir()
        command = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24", "stellarium"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        env = home_of(Path(home), **REMOTE)
        screen = subprocess.Popen(command, env=env, start_new_session=True, **quiet)
        follow = ["telescope", "--folder", str(frames), "--offer", "lx200=0", "--stellarium-remote"]
        offered = subprocess.Popen([*us, *follow], stdout=subprocess.PIPE, text=True)
        said = []
        threading.Thread(target=lambda: said.extend(iter(offered.stdout.readline, "")), daemon=True).start()
        try:
            assert wait_for(up, 120.0)
            time.sleep(10.0)  # until its stars have their names
            shutil.copy(SAMPLE, frames)
            follows = wait_for(lambda: apart_deg(view_deg(), place) < 1.0 / 60.0, 60.0)
            shown = view_deg()
            ask("scripts/direct", code='core.selectObjectByName("Vega", true);')
            taken = wait_for(lambda: any("set a target: Vega" in line for line in said), 20.0)
            shutil.copy(SAMPLE, frames / "next.png")
            wait_for(lambda: any(line.startswith("Push ") for line in said), 60.0)
            folder = pictures.resolve()
            ask("scripts/direct", code=f'core.wait(1); core.screenshot("remote", false, "{folder}/", true);')
            time.sleep(5.0)
        finally:
            offered.terminate()
            offered.wait(20)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(screen.pid, signal.SIGTERM)
    print("".join(said))
    print(f"solved {place[0]:.4f} {place[1]:+.4f}, Stellarium looks at {shown[0]:.4f} {shown[1]:+.4f}")
    return follows and taken and re.search(r"^Push ", "".join(said), re.MULTILINE) is not None


if __name__ == "__main__":
    sys.exit(not main(Path(sys.argv[1])))
