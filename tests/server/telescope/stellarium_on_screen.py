"""Debian's Stellarium on a virtual screen steers a practice mount through us: ``python -m tests.server.telescope.stellarium_on_screen FOLDER``.

It connects to port 10001, is told the pointing, and slews the telescope to Capella by its own command; pictures before
and after go into FOLDER. What it prints is our side's; its exit code is 0 when the mount arrived within 1'. Takes a
minute; needs Linux, root, xvfb and stellarium. Everything runs in a network of its own.
"""

import configparser
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from kochab.core.attitude import apart_deg
from tests.gear.cameras.own_network import own_network

CAPELLA_DEG, SITE, PATIENCE_S = (79.1726, 45.9949), "48,11", 150.0  # of 2026, J2000
TELESCOPES = {
    "version": "0.4.1",
    "1": {"connect_at_startup": True, "connection": "remote", "delay": 500000, "equinox": "J2000",
          "host_name": "localhost", "name": "Kochab", "tcp_port": 10001},
}  # fmt: skip
"""As the plug-in of Stellarium 0.22 writes it; another version of the file it throws away."""
SCRIPT = """
core.wait(8);
core.setObserverLocation(11.0, 48.0, 500, 0, "Munich");
core.selectObjectByName("Capella", false);
core.moveToSelectedObject(1);
StelMovementMgr.zoomTo(50, 1);
core.wait(3);
core.screenshot("before", false, "{folder}/", true);
TelescopeControl.slewTelescopeToSelectedObject(1);
core.wait(25);
core.screenshot("there", false, "{folder}/", true);
core.wait(1);
core.quitStellarium();
"""


def home_of(folder, script="", **settings):
    """A home with one plug-in on, our telescope in it, and the script; ``settings`` are sections of its config."""
    modules = folder / ".stellarium" / "modules" / "TelescopeControl"
    modules.mkdir(parents=True)
    (modules / "telescopes.json").write_text(json.dumps(TELESCOPES))
    config = configparser.RawConfigParser(strict=False)
    config.optionxform = str
    config.read("/usr/share/stellarium/data/default_cfg.ini")
    plugins = dict.fromkeys(("Satellites", "SolarSystemEditor", "Exoplanets", "Novae", "MeteorShowers"), "false")
    first = {"plugins_load_at_startup": {**plugins, "TelescopeControl": "true"}, "video": {"fullscreen": "false"}}
    rows = [
        (section, name, value) for section, more in (*first.items(), *settings.items()) for name, value in more.items()
    ]
    for section, name, value in rows:
        if not config.has_section(section):
            config.add_section(section)
        config.set(section, name, value)
    with open(folder / ".stellarium" / "config.ini", "w", encoding="utf-8") as file:
        config.write(file)
    scripts = folder / ".stellarium" / "scripts"
    scripts.mkdir()
    (scripts / "steer.ssc").write_text(script)
    return {**os.environ, "HOME": str(folder), "LIBGL_ALWAYS_SOFTWARE": "1"}


def main(pictures):
    """Run it; whether the mount arrived."""
    pictures.mkdir(parents=True, exist_ok=True)
    us = [sys.executable, "-m", "app"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with own_network(), tempfile.TemporaryDirectory() as home:
        night = subprocess.Popen([*us, "practice", "--socket", "--json", "--lost", "0", "--site", SITE], **pipes)
        port = json.loads(night.stdout.readline())["port"]
        mount = ["--port", port, "--driver", "lx200", "--site", SITE, "--yes"]
        offered = subprocess.Popen([*us, "telescope", *mount, "--offer", "stellarium"], **pipes)
        said = []
        threading.Thread(target=lambda: said.extend(iter(offered.stdout.readline, "")), daemon=True).start()
        try:
            command = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24", "stellarium", "--startup-script", "steer.ssc"]
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            env = home_of(Path(home), SCRIPT.format(folder=pictures.resolve()))
            screen = subprocess.Popen(command, env=env, start_new_session=True, **quiet)
            try:
                screen.wait(PATIENCE_S)
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(screen.pid, signal.SIGTERM)
            time.sleep(1.0)
        finally:
            for process in (offered, night):
                process.terminate()
                process.wait(20)
    print("".join(said))
    reached = re.search(r"reached RA (\d+\.\d+) Dec ([+-]\d+\.\d+)", "".join(said))
    return reached is not None and apart_deg(tuple(map(float, reached.groups())), CAPELLA_DEG) < 1.0 / 60.0


if __name__ == "__main__":
    sys.exit(not main(Path(sys.argv[1])))
