"""INDI's EQMod driver with its own simulated board: run by `test_eqmod_axes.py`, as a script, in a network of its own.

On standard input ``{"site", "targets", "patience_s"}``, degrees, a target as hour angle and declination; on standard
output what it reads at home and at every target: RA, Dec, both counters, the side of the pier and the time.
"""

import json
import os
import subprocess
import sys
import time

from responder_indi import PLACE, PORT, Client

DEVICE = "EQMod Mount"


def reading(client):
    """What it says now."""
    values = client.values
    steps = values["CURRENTSTEPPERS"]
    return {
        "place": client.place(),
        "steps": (float(steps["RAStepsCurrent"]), float(steps["DEStepsCurrent"])),
        "turn": float(values["STEPPERS"]["RASteps360"]),
        "west": values["TELESCOPE_PIER_SIDE"]["PIER_WEST"] == "On",
        "unix_s": time.time(),
    }


def run(plan):
    """Connect to the simulated board, and go from home to every target."""
    client = Client(DEVICE, plan["patience_s"])
    values, states = client.values, client.states
    client.wait("device", lambda: "CONNECTION" in values and "SIMULATION" in values)
    client.order("Switch", "SIMULATION", ENABLE="On")
    client.wait("simulation", lambda: values["SIMULATION"].get("ENABLE") == "On")
    client.wait("port", lambda: "DEVICE_AUTO_SEARCH" in values)
    client.order("Switch", "DEVICE_AUTO_SEARCH", INDI_DISABLED="On")
    client.order("Switch", "CONNECTION", CONNECT="On")
    client.wait("connection", lambda: values["CONNECTION"]["CONNECT"] == "On" and states["CONNECTION"] == "Ok")
    latitude, longitude = plan["site"]
    client.wait("site to set", lambda: "GEOGRAPHIC_COORD" in values and "TELESCOPE_PARK" in values)
    client.order("Number", "GEOGRAPHIC_COORD", LAT=latitude, LONG=longitude, ELEV=100)
    client.order("Switch", "TELESCOPE_PARK", UNPARK="On")
    named = ("CURRENTSTEPPERS", "STEPPERS", "TELESCOPE_PIER_SIDE", PLACE, "ON_COORD_SET")
    client.wait("counters", lambda: all(name in values for name in named) and PLACE in client.told)
    found = [reading(client)]
    client.order("Switch", "ON_COORD_SET", TRACK="On")
    for place in plan["targets"]:
        client.order("Number", PLACE, RA=place[0] / 15.0, DEC=place[1])
        client.wait("arrival", lambda p=place: client.near(p))
        client.told.clear()
        client.wait("fresh counters", lambda: "CURRENTSTEPPERS" in client.told)
        found.append(reading(client))
    return found


def main():
    """One driver behind one server."""
    plan = json.load(sys.stdin)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    with open(os.path.join(os.environ["HOME"], "indiserver.log"), "wb") as log:
        server = subprocess.Popen(["indiserver", "-p", str(PORT), "indi_eqmod_telescope"], stderr=log, stdout=log)
    try:
        json.dump(run(plan), sys.stdout)
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main()
