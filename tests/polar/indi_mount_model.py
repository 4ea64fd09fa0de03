"""INDI's telescope simulator with an axis off the pole, in a network of its own; run as a script.

On standard input: ``{"latitude", "longitude", "ma", "me", "start": [RA, Dec], "patience_s"}``,
degrees. On standard output:
``[[unix seconds, RA, Dec], ...]``, degrees of date, while the simulator turns west about its axis.
"""

import json
import os
import subprocess
import sys
import time

from tests.simulate.responder_indi import PLACE, PORT, Client

DEVICE = "Telescope Simulator"
TURN_DEG = 50.0


def positions(client, plan):
    """Misalign the simulator, point it, turn it west and note where it goes."""
    values = client.values
    client.wait("device", lambda: "CONNECTION" in values)
    client.order("Switch", "CONNECTION", CONNECT="On")
    client.wait("position", lambda: PLACE in client.told and "ON_COORD_SET" in values)
    client.order("Number", "GEOGRAPHIC_COORD", LAT=plan["latitude"], LONG=plan["longitude"], ELEV=0)
    client.order("Switch", "TELESCOPE_PARK", UNPARK="On")
    model = {"MM_IH": 0, "MM_ID": 0, "MM_CH": 0, "MM_NP": 0, "MM_MA": plan["ma"], "MM_ME": plan["me"]}
    client.order("Number", "MOUNT_MODEL", **model)
    client.order("Switch", "ON_COORD_SET", TRACK="On")
    client.order("Number", PLACE, RA=plan["start"][0] / 15.0, DEC=plan["start"][1])
    client.wait("slew", lambda: client.states[PLACE] == "Busy")
    client.wait("arrival", lambda: client.states[PLACE] != "Busy")
    client.order("Switch", "TELESCOPE_SLEW_RATE", **{"4x": "On"})
    client.order("Switch", "TELESCOPE_MOTION_WE", MOTION_WEST="On")
    seen, turned, last = [], 0.0, None
    while turned < TURN_DEG:
        client.told.discard(PLACE)
        client.wait("next position", lambda: PLACE in client.told)
        now = client.place()
        seen.append([time.time(), *now])
        if last is not None:
            turned += abs((now[0] - last[0] + 180.0) % 360.0 - 180.0)
        last = now
    client.order("Switch", "TELESCOPE_MOTION_WE", MOTION_WEST="Off")
    return seen


def main():
    """One server, one simulator."""
    plan = json.load(sys.stdin)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    with open(os.path.join(os.environ["HOME"], "indiserver.log"), "wb") as log:
        server = subprocess.Popen(["indiserver", "-p", str(PORT), "indi_simulator_telescope"], stderr=log, stdout=log)
    try:
        json.dump(positions(Client(DEVICE, plan["patience_s"]), plan), sys.stdout)
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main()
