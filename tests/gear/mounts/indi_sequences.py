"""Random evenings at INDI's own simulated mounts: ``python -m tests.gear.mounts.indi_sequences 60``, as root on Linux.

Nothing of the far end is ours: `indi_simulator_telescope`, whose two axes its MOUNT_AXES tell, and
`indi_eqmod_telescope` over its simulated board, whose step counters it tells. INDI's clock is the computer's, so that
an evening takes a minute; several are played at once, each at a server of its own.
"""

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from kochab.core.errors import KochabError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Direction, Epoch, Pointing, TrackingRate
from kochab.gear import mount_events as events
from kochab.gear.mount_line import MountLine
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits, SyncEvidence
from kochab.sky.horizon import sidereal_deg
from kochab.workflows.nudge import nudge
from tests.gear.cameras.own_network import own_network
from tests.gear.mounts.sequences import FALLS_DEG, LOW_DEG, PAST_DEG, altitude_deg, ordered, place_of_axes
from tests.simulate import responder_indi

SITE = Site(50.0, 8.0)
SIMULATOR, EQMOD = "Telescope Simulator", "EQMod Mount"
PROGRAMS = {SIMULATOR: "indi_simulator_telescope", EQMOD: "indi_eqmod_telescope"}
AT_ONCE, STEPS = 6, 10
TOLERANCE_DEG, OWN_WAY_DEG = 1.0, 6.0  # its place is told four times a second, and it slews at up to 5 deg/s
SLACK_DEG = 0.2
NUDGE_DEG = 2.5  # beyond the pole the simulator's keys for north and south are exchanged: a nudge, then, goes down
CHANCES = {"goto": 6, "nudge": 3, "pulse": 1, "sync": 2, "track": 2, "park": 1, "stop": 2, "other": 3, "kill": 2}
MOTIONS = ("EQUATORIAL", "TELESCOPE_MOTION", "TELESCOPE_TIMED", "TELESCOPE_PARK", "TELESCOPE_TRACK_STATE")


class Watched(responder_indi.Client):
    """INDI's words in a connection of our own, beside Kochab's."""

    def __init__(self, device, port):
        self.port = port
        super().__init__(device, 3600.0)

    def _connect(self):
        while True:
            try:
                return socket.create_connection(("127.0.0.1", self.port), timeout=60)
            except ConnectionRefusedError:
                time.sleep(0.05)

    def set(self, name, member, **more):
        """A switch when the driver has told of it."""
        self.wait(name, lambda: member in self.values.get(name, ()))
        self.order("Switch", name, **{member: "On"}, **more)

    def axes_deg(self):
        """Hour angle and declination of the axes, the tube east of the pier; home is 90, 90."""
        if self.device == SIMULATOR:
            return tuple(float(self.values["MOUNT_AXES"][name]) for name in ("PRIMARY", "SECONDARY"))
        now, turn = self.values["CURRENTSTEPPERS"], self.values["STEPPERS"]
        first = (float(now["RAStepsCurrent"]) - 0x800000) / float(turn["RASteps360"]) * 360.0
        second = (float(now["DEStepsCurrent"]) - 0x800000) / float(turn["DESteps360"]) * 360.0
        return 90.0 + first, 180.0 - second  # at home the second counter is a quarter turn above the middle


class Evening:
    """One device of one server, whoever uses it, and Kochab's line in a thread."""

    def __init__(self, seed, port):
        self.seed, self.port = seed, port
        self.rng = np.random.default_rng([seed, 15])
        self.device = (SIMULATOR, EQMOD)[seed % 2]
        self.counts, self.violations = Counter(), []
        self.mover, self.kind, self.began_deg = "other", "", 90.0
        self.line = self.guard = self.thread = None
        self.asked, self.stopped_at, self.step = False, None, "begin"
        self.before = None
        self.over = False

    # the truth

    def watch(self):
        """In a thread: every place of the axes that the driver tells."""
        vector = "MOUNT_AXES" if self.device == SIMULATOR else "CURRENTSTEPPERS"
        client = self.client
        while not self.over:
            client.told.discard(vector)
            with suppress(OSError, TimeoutError):
                client.wait(vector, lambda: self.over or vector in client.told)
                self.look(client.axes_deg())

    def look(self, axes):
        hour, dec, weights = place_of_axes(*axes)
        altitude = altitude_deg(hour, dec, SITE.latitude_deg)
        now, before = time.monotonic(), self.before
        self.before = now, axes, altitude, weights
        self.counts["looks"] += 1
        if before is None:
            return
        then, (first, second), was_high, was_out = before
        passed = now - then
        slack = SLACK_DEG + 2.0 * SIDEREAL_DEG_S * passed
        fast = abs(axes[0] - first) > slack or abs(axes[1] - second) > slack
        if not fast or self.mover != "kochab":
            return
        self.counts["looks at a motion of ours"] += 1
        beyond = OWN_WAY_DEG if "PARK" in self.kind else TOLERANCE_DEG
        turned = self.device == SIMULATOR and self.kind.endswith("_NS") and altitude > self.began_deg - NUDGE_DEG
        if altitude < LOW_DEG - beyond and altitude < was_high - FALLS_DEG and not turned:
            self.found(f"{altitude:.1f} deg high")
        elif weights > 90.0 + PAST_DEG + TOLERANCE_DEG and weights > was_out:
            self.found(f"the weights {weights:.1f} deg from below")
        elif self.stopped_at is not None and then > self.stopped_at:
            self.found("it moves after a Stop that was seen")

    def found(self, sentence):
        self.violations.append(f"{self.step}: {sentence}, {self.kind}")
        self.mover = "found"

    def true_deg(self):
        hour, dec, _ = place_of_axes(*self.client.axes_deg())
        return (sidereal_deg(SITE, datetime.now(UTC)) - hour) % 360.0, dec

    # Kochab

    def connect(self):
        if self.line is not None:
            return

        def opening():
            mount = open_mount("indi", f"localhost:{self.port}/{self.device}", site=SITE)
            send = mount._device.send

            def noted(vector, members):
                if vector.startswith(MOTIONS) and set(members.values()) != {"Off"}:
                    self.mover, self.kind, self.stopped_at = "kochab", vector, None
                    self.began_deg = 90.0 if self.before is None else self.before[2]
                    self.counts["orders of ours"] += 1
                    if not self.asked:
                        self.found("an order that nobody asked for")
                return send(vector, members)

            mount._device.send = noted
            self.guard = Guard(mount, SITE, Limits(allow_flip=self.seed % 4 < 2))
            return self.guard

        self.line = MountLine(opening, self.tell)
        self.running = self.line.run()
        self.gone = threading.Event()
        self.thread = threading.Thread(target=self.serve, args=(self.running, self.gone), daemon=True)
        self.thread.start()
        self.wait_for(lambda: self.guard is not None or not self.thread.is_alive(), 30.0)

    def serve(self, running, gone):
        with suppress(KochabError):
            for _ in running:
                if gone.is_set():
                    break
        with suppress(KochabError, RuntimeError):
            running.close()

    def tell(self, event):
        self.counts[type(event).__name__] += 1
        if isinstance(event, events.StandsStill):
            self.stopped_at = time.monotonic()
        if isinstance(event, (events.OrderDone, events.OrderFailed)):
            self.asked = False

    def leave(self, killed=False):
        """Disconnect; ``killed``: nothing more is sent, as by ``kill -9``."""
        if self.line is None:
            return
        if killed and self.guard is not None:
            self.guard.mount.watchdog.disarm()
            self.guard.mount._link._lose()
        self.gone.set()
        self.thread.join(30.0)
        if killed and self.guard is not None:
            self.guard.mount._link.close()
        self.line = self.guard = None
        self.asked = False

    def order(self, name, do, meanwhile):
        self.connect()
        if self.guard is None:
            self.leave()
            return
        self.asked = True
        self.line.order(name, partial(ordered, name, do))
        self.counts[name] += 1
        if meanwhile < 0.3:
            time.sleep(0.5 + 10.0 * meanwhile)
            if meanwhile < 0.2:
                self.line.stop()
            else:
                self.leave(killed=True)
                time.sleep(4.0)
        self.wait_for(lambda: not self.asked or self.line is None or not self.thread.is_alive(), 150.0)
        self.asked = False

    def wait_for(self, condition, seconds):
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            time.sleep(0.05)

    # the steps

    def own(self, place):
        return self.guard.to_mount(*from_mount_epoch(Pointing(*place, Epoch.DATE), datetime.now(UTC)))

    def play(self):
        client = self.client = Watched(self.device, self.port)
        client.wait("device", lambda: "CONNECTION" in client.values)
        if self.device == EQMOD:
            client.wait("simulation", lambda: "SIMULATION" in client.values)
            client.order("Switch", "SIMULATION", ENABLE="On")
        client.set("CONNECTION", "CONNECT")
        client.wait("connected", lambda: client.states["CONNECTION"] == "Ok" and "TELESCOPE_PARK" in client.values)
        client.order("Number", "GEOGRAPHIC_COORD", LAT=SITE.latitude_deg, LONG=SITE.longitude_deg, ELEV=100)
        client.order("Number", "POLLING_PERIOD", PERIOD_MS=250)
        client.set("TELESCOPE_PARK", "UNPARK")
        if self.device == EQMOD:
            client.set("ALIGNSYNCMODE", "ALIGNSTANDARDSYNC")
            client.wait("steps", lambda: {"CURRENTSTEPPERS", "STEPPERS"} <= client.values.keys())
        else:
            client.wait("axes", lambda: "MOUNT_AXES" in client.values)
        watching = threading.Thread(target=self.watch, daemon=True)
        watching.start()
        try:
            names, weights = list(CHANCES), np.array(list(CHANCES.values()), dtype=float)
            for k in range(STEPS):
                name = str(self.rng.choice(names, p=weights / weights.sum()))
                self.step = f"step {k}, {name}"
                getattr(self, f"do_{name}")(*self.rng.random(5).tolist())
        finally:
            self.leave()
            self.over = True
            client.set("TELESCOPE_ABORT_MOTION", "ABORT")
            watching.join(5.0)
        return self

    def do_goto(self, a, b, c, *_):
        hour, dec = 240.0 * (a - 0.5), float(np.degrees(np.arcsin(-0.4 + 1.38 * b)))
        target = (sidereal_deg(SITE, datetime.now(UTC)) - hour) % 360.0, dec
        self.order("goto", lambda guard: guard.slew(*self.own(target)), c)

    def do_nudge(self, a, b, c, *_):
        """By an angle up to 2 deg, as the arrows of the window do."""
        direction, arcsec = list(Direction)[int(4 * a)], 10.0 ** (1.0 + 2.8 * b)
        self.order("nudge", lambda guard: nudge(guard, direction, arcsec), c)

    def do_pulse(self, a, b, *_):
        self.order("pulse", lambda guard: guard.pulse(list(Direction)[int(4 * a)], int(50 + 2000 * b)), 1.0)

    def do_sync(self, a, *_):
        def do(guard):
            ra, dec = self.true_deg()
            place = ra, dec - (1.0 + 4.0 * a) / 3600.0
            solved = from_mount_epoch(Pointing(*place, Epoch.DATE), datetime.now(UTC))
            guard.sync(*self.own(place), SyncEvidence((solved, solved), (0.3, 0.3), (-20.0, -20.0)), confirmed=True)

        self.order("sync", do, 1.0)

    def do_track(self, a, *_):
        self.order("track", lambda guard: guard.track(TrackingRate.OFF if a < 0.4 else TrackingRate.SIDEREAL), 1.0)

    def do_park(self, a, b, *_):
        self.order("park", lambda guard: guard.rest("park"), a)
        self.order("unpark", lambda guard: guard.unpark(), 1.0)

    def do_stop(self, *_):
        if self.line is not None:
            self.line.stop()
            time.sleep(4.0)

    def do_other(self, a, b, c, *_):
        """Another program at the same server."""
        self.mover, self.stopped_at, client = "other", None, self.client
        if a < 0.6:
            client.set("ON_COORD_SET", "TRACK")
            dec = 60.0 * b
            ra = (sidereal_deg(SITE, datetime.now(UTC)) - 140.0 * (c - 0.5)) % 360.0
            client.order("Number", responder_indi.PLACE, RA=ra / 15.0, DEC=dec)
            time.sleep(1.0 + 10.0 * b)
        else:
            client.order("Switch", "TELESCOPE_MOTION_NS", MOTION_NORTH="On")
            time.sleep(0.5 + 2.0 * b)
            client.order("Switch", "TELESCOPE_MOTION_NS", MOTION_NORTH="Off")

    def do_kill(self, *_):
        self.leave(killed=True)
        time.sleep(2.0)


def play(seed):
    """One evening at a server of its own."""
    port, home = 7700 + seed, Path(tempfile.mkdtemp(prefix="kochab-indi-"))
    evening = Evening(seed, port)
    server = subprocess.Popen(
        ["indiserver", "-p", str(port), "-u", str(home / "socket"), PROGRAMS[evening.device]],
        env={**os.environ, "HOME": str(home)},
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return evening.play()
    finally:
        os.killpg(server.pid, signal.SIGKILL)
        server.wait(20)
        shutil.rmtree(home, ignore_errors=True)


def main() -> int:
    """Play so many evenings, and tell how each of INDI's mounts fared; 1 when a rule was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=60)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    rows = {name: Counter() for name in PROGRAMS}
    with own_network(), ThreadPoolExecutor(AT_ONCE) as pool:
        for evening in pool.map(play, range(given.first, given.first + given.count)):
            row = rows[evening.device]
            row += evening.counts
            row["evenings"] += 1
            row["violations"] += len(evening.violations)
            if evening.violations:
                print(evening.seed, evening.device, *evening.violations, sep="\n    ", flush=True)
    for name, row in rows.items():
        print(PROGRAMS[name], dict(row))
    return int(any(row["violations"] for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
