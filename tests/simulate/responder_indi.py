"""INDI's drivers at work, in a network of their own: run by `test_indi.py`, as a script.

On standard input: ``{"drivers": [{"driver", "device", "port", "sync", "goto", "site"}]}``, angles
in degrees. On standard output, as JSON: for each driver what it read back, or what went wrong.
"""

import json
import os
import socket
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ElementTree

PORT = 7624
NEAR_DEG = 0.02
PLACE = "EQUATORIAL_EOD_COORD"


class Client:
    """One device's properties as its driver tells them, and orders to it."""

    def __init__(self, device, patience_s):
        self.device, self.until = device, time.monotonic() + patience_s
        self.values, self.states, self.messages = {}, {}, []
        self.told = set()  # what has been told anew since it was defined
        self.parser = ElementTree.XMLPullParser(["start", "end"])
        self.parser.feed("<indi>")
        self.line = self._connect()
        self.line.sendall(f'<getProperties version="1.7" device="{device}"/>'.encode())

    def _connect(self):
        while True:
            try:
                return socket.create_connection(("127.0.0.1", PORT), timeout=60)
            except ConnectionRefusedError:
                if time.monotonic() > self.until:
                    raise
                time.sleep(0.05)

    def order(self, kind, name, **elements):
        """``kind`` is Switch, Number or Text."""
        inner = "".join(f'<one{kind} name="{n}">{v}</one{kind}>' for n, v in elements.items())
        what = f'<new{kind}Vector device="{self.device}" name="{name}">{inner}</new{kind}Vector>'
        self.line.sendall(what.encode())

    def wait(self, wish, fulfilled):
        """Read until ``fulfilled()``."""
        while not fulfilled():
            left = self.until - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"no {wish}; it said {self.messages[-6:]}")
            self.line.settimeout(left)
            data = self.line.recv(65536)
            if not data:
                raise ConnectionError(f"the server went away before {wish}")
            self.parser.feed(data)
            self._take()

    def _take(self):
        depth_of = ("def", "set")
        for event, element in self.parser.read_events():
            if event == "start" or not element.tag.startswith((*depth_of, "message")):
                continue
            if element.get("message"):
                self.messages.append(element.get("message"))
            if element.tag.endswith("Vector"):
                name = element.get("name")
                self.states[name] = element.get("state", self.states.get(name))
                if element.tag.startswith("set"):
                    self.told.add(name)
                into = self.values.setdefault(name, {})
                into.update({one.get("name"): (one.text or "").strip() for one in element})
                element.clear()

    def near(self, place):
        """Whether it says that it points there, and is at rest."""
        told = self.place()
        apart = max(abs((told[0] - place[0] + 180) % 360 - 180), abs(told[1] - place[1]))
        return apart < NEAR_DEG and self.states[PLACE] != "Busy"

    def place(self):
        """Degrees of date."""
        told = self.values[PLACE]
        return float(told["RA"]) * 15.0, float(told["DEC"])


def run(plan, patience_s):
    """Connect, sync, goto; what was read back."""
    client = Client(plan["device"], patience_s)
    values, states = client.values, client.states
    client.wait("device", lambda: "CONNECTION" in values and values.keys() & {"CONNECTION_MODE", "DEVICE_PORT"})
    if "CONNECTION_MODE" in values:
        client.order("Switch", "CONNECTION_MODE", CONNECTION_SERIAL="On")
        client.wait("serial line", lambda: values["CONNECTION_MODE"]["CONNECTION_SERIAL"] == "On")
    client.wait("port to set", lambda: "DEVICE_PORT" in values and "DEVICE_AUTO_SEARCH" in values)
    client.order("Switch", "DEVICE_AUTO_SEARCH", INDI_DISABLED="On")
    client.order("Text", "DEVICE_PORT", PORT=plan["port"])
    client.order("Switch", "CONNECTION", CONNECT="On")
    client.wait("connection", lambda: values["CONNECTION"]["CONNECT"] == "On" and states["CONNECTION"] == "Ok")
    # A driver that has not yet read the mount would go from nowhere.
    client.wait("position", lambda: PLACE in client.told and "ON_COORD_SET" in values)
    latitude, longitude = plan["site"]
    client.order("Number", "GEOGRAPHIC_COORD", LAT=latitude, LONG=longitude, ELEV=100)
    client.order("Switch", "TELESCOPE_PARK", UNPARK="On")
    if plan.get("track"):
        client.order("Switch", "TELESCOPE_TRACK_STATE", TRACK_ON="On")
    seen = {}
    for act, switch in (("sync", "SYNC"), ("goto", "TRACK")):
        if plan[act] is None:
            continue
        client.order("Switch", "ON_COORD_SET", **{switch: "On"})
        client.wait(switch, lambda s=switch: values["ON_COORD_SET"].get(s) == "On")
        client.order("Number", PLACE, RA=plan[act][0] / 15.0, DEC=plan[act][1])
        client.wait(f"arrival after {act}", lambda a=act: client.near(plan[a]))
        seen[act] = client.place()
    if plan.get("rest"):
        for name, member in (("TELESCOPE_TRACK_MODE", "TRACK_LUNAR"), ("TELESCOPE_PARK", "PARK")):
            client.order("Switch", name, **{member: "On"})
            client.wait(
                member, lambda n=name, m=member: values[n].get(m) == "On" and states[n] != "Busy" and n in client.told
            )
            seen[member] = states[name]
    return seen


def main():
    """All drivers at once, behind one server."""
    plans, patience_s = json.load(sys.stdin).values()
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    drivers = [plan["driver"] for plan in plans]
    with open(os.path.join(os.environ["HOME"], "indiserver.log"), "wb") as log:
        server = subprocess.Popen(["indiserver", "-p", str(PORT), *drivers], stderr=log, stdout=log)
    seen = {}

    def one(plan):
        try:
            seen[plan["driver"]] = run(plan, patience_s)
        except (OSError, TimeoutError, ValueError, KeyError) as error:
            seen[plan["driver"]] = {"error": f"{type(error).__name__}: {error}"}

    threads = [threading.Thread(target=one, args=(plan,)) for plan in plans]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    server.terminate()
    server.wait()
    json.dump(seen, sys.stdout)


if __name__ == "__main__":
    main()
