"""The telescope as an INDI device at port 7624: KStars and Ekos, PHD2, Cartes du Ciel.

One device with the standard properties of a telescope; coordinates are of date (``EQUATORIAL_EOD_COORD``). Its state is
shared by all clients, as INDI has it. Facts: INDI white paper, protocol 1.7; names, members and their order as
``inditelescope.cpp`` defines them.
"""

import asyncio
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import field
from datetime import UTC, datetime
from typing import Any
from xml.etree.ElementTree import Element, ParseError, XMLPullParser
from xml.sax.saxutils import escape, quoteattr

from kochab.core import __version__
from kochab.core.mount import Epoch, Pointing
from kochab.core.values import frozen, mutable
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.server.telescope.listening import Line, NotTheProtocol, Ports, verdict_of
from kochab.workflows.telescope.offered import OfferedTelescope

DEVICE = "Kochab"
LONGEST_ELEMENT = 16_384  # bytes
EVERY_S = 0.5
CONNECTION, ON_SET, ABORT = "CONNECTION", "ON_COORD_SET", "TELESCOPE_ABORT_MOTION"
COORD, TARGET, SITE, INFO = "EQUATORIAL_EOD_COORD", "TARGET_EOD_COORD", "GEOGRAPHIC_COORD", "DRIVER_INFO"
RA_DEC = {"RA": ("RA (hh:mm:ss)", "%010.6m", 0, 24), "DEC": ("DEC (dd:mm:ss)", "%010.6m", -90, 90)}
PLACE = {
    "LAT": ("Lat (dd:mm:ss)", "%012.8m", -90, 90),
    "LONG": ("Lon (dd:mm:ss)", "%012.8m", 0, 360),
    "ELEV": ("Elevation (m)", "%g", -200, 10000),
}
TELESCOPE_INTERFACE = "1"
SEXAGESIMAL = re.compile(r"([+-]?)(\d+(?:\.\d*)?(?:e[+-]?\d+)?)(?:[:; ](\d+(?:\.\d*)?))?(?:[:; ](\d+(?:\.\d*)?))?")


def listen(ports: Ports, port: int) -> int:
    """Offer it at a port, 0 for any, and return that; PortError when it cannot be had."""
    return ports.listen("INDI", Device(ports.telescope).talk, port)


@frozen
class Property:
    """One vector as it stands now: ``kind`` is Switch, Number or Text; ``perm`` r, w or both."""

    kind: str
    name: str
    label: str
    state: str
    values: Mapping[str, str | float]
    perm: str = "rw"
    message: str = ""

    def defined(self) -> str:
        """The element that tells a client of it."""
        rule = ' rule="OneOfMany"' if self.kind == "Switch" else ""
        inner = "".join(self._member(name, value, True) for name, value in self.values.items())
        return (
            f'<def{self.kind}Vector {self._head()} label={quoteattr(self.label)} group="Main Control"'
            f' perm="{self.perm}"{rule} timeout="60">{inner}</def{self.kind}Vector>'
        )

    def changed(self) -> str:
        """The element that tells of its new values."""
        inner = "".join(self._member(name, value, False) for name, value in self.values.items())
        message = f" message={quoteattr(self.message)}" if self.message else ""
        return f'<set{self.kind}Vector {self._head()} timeout="60"{message}>{inner}</set{self.kind}Vector>'

    def _head(self) -> str:
        now = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%S}"
        return f'device="{DEVICE}" name="{self.name}" state="{self.state}" timestamp="{now}"'

    def _member(self, name: str, value: str | float, define: bool) -> str:
        """One value, in its definition with label and range."""
        tag = f"{'def' if define else 'one'}{self.kind}"
        label, limits = name, ""
        if define and self.kind == "Number":
            label, form, low, high = (RA_DEC | PLACE)[name]
            limits = f' format="{form}" min="{low}" max="{high}" step="0"'
        labelled = f" label={quoteattr(label)}{limits}" if define else ""
        text = f"{value:.10g}" if isinstance(value, float) else escape(value)
        return f'<{tag} name="{name}"{labelled}>{text}</{tag}>'


class Elements:
    """Cuts a stream into elements of the protocol, none of them long; it has no declarations, so none are read."""

    def __init__(self) -> None:
        self._parser: Any = XMLPullParser(("start", "end"))
        self._parser.feed(b"<indi>")
        self._depth, self._bytes, self._last = 0, 0, b""
        self._root: Element | None = None

    def feed(self, data: bytes) -> list[Element]:
        """The elements that are whole; NotTheProtocol when it is no XML, or one never ends."""
        if self._root is None and not self._depth and data.lstrip()[:1] not in (b"", b"<"):
            raise NotTheProtocol  # a web browser's request, which XML would take for text
        if b"<!" in self._last + data or b"<?" in self._last + data:
            raise NotTheProtocol
        self._last = data[-1:]
        self._bytes += len(data)
        whole: list[Element] = []
        try:
            self._parser.feed(data)
            for event, element in self._parser.read_events():
                self._depth += 1 if event == "start" else -1
                self._root = element if self._root is None else self._root
                if self._depth == 1 and event == "end":
                    whole.append(element)
        except ParseError:
            raise NotTheProtocol from None
        if whole and self._root is not None:
            self._root.clear()
            self._bytes = 0
        if self._bytes > LONGEST_ELEMENT or self._depth < 1:
            raise NotTheProtocol
        return whole


@mutable(eq=False)
class Device:
    """The device and its state."""

    telescope: OfferedTelescope
    connected: bool = False
    on_set: str = "TRACK"
    refused: str = ""
    clients: dict[Line, dict[str, str]] = field(default_factory=dict)
    """Each client, and what it was told last of each property."""

    def properties(self) -> Iterator[Property]:
        """All of it as it stands now; while it is not connected, little."""
        on, off = ("On", "Off") if self.connected else ("Off", "On")
        yield Property("Switch", CONNECTION, "Connection", "Ok" if self.connected else "Idle",
                       {"CONNECT": on, "DISCONNECT": off})  # fmt: skip
        yield Property("Text", INFO, "Driver Info", "Idle", {
            "DRIVER_NAME": DEVICE, "DRIVER_EXEC": "kochab", "DRIVER_VERSION": __version__,
            "DRIVER_INTERFACE": TELESCOPE_INTERFACE,
        }, "ro")  # fmt: skip
        if not self.connected:
            return
        choices = {name: "On" if name == self.on_set else "Off" for name in ("TRACK", "SLEW", "SYNC")}
        yield Property("Switch", ON_SET, "On Set", "Ok", choices)
        seen, now = self.telescope.seen, self.telescope.now()
        here = (0.0, 0.0) if seen is None else to_mount_epoch(*seen.icrs_deg, Epoch.DATE, now)
        busy = seen is not None and seen.slewing
        state = "Busy" if busy else "Alert" if self.refused else "Idle" if seen is None or seen.past else "Ok"
        yield Property("Number", COORD, "Eq. Coordinates", state, _hours(here), message=self.refused)
        if (target := self.telescope.target) is not None:
            there = to_mount_epoch(target.ra_deg, target.dec_deg, Epoch.DATE, now)
            yield Property("Number", TARGET, "Slew Target", "Ok", _hours(there), "ro")
        yield Property("Switch", ABORT, "Abort Motion", "Idle", {"ABORT": "Off"})
        if (site := self.telescope.site) is not None:
            place = {"LAT": site.latitude_deg, "LONG": site.longitude_deg % 360.0, "ELEV": site.height_m}
            yield Property("Number", SITE, "Scope Location", "Ok", place, "ro")

    async def talk(self, line: Line) -> None:
        """Serve one client until it goes."""
        self.clients[line] = {}
        telling = asyncio.ensure_future(self._keep_telling(line))
        elements = Elements()
        try:
            while data := await line.read():
                for element in elements.feed(data):
                    await self._take(element, line)
                if telling.done():
                    telling.result()
        finally:
            telling.cancel()
            del self.clients[line]

    async def _keep_telling(self, line: Line) -> None:
        while True:
            await asyncio.sleep(EVERY_S)
            await self._tell(line)

    async def _tell(self, line: Line, anew: str | None = None) -> None:
        """Send what has changed, and define what was not sent before; ``anew`` defines all again, or the one named."""
        defined = self.clients[line]
        if anew is None and not defined:
            return  # it has not asked yet
        current = {prop.name: prop for prop in self.properties()}
        out = []
        for name in [name for name in defined if name not in current]:
            del defined[name]
            out.append(f'<delProperty device="{DEVICE}" name="{name}"/>')
        for name, prop in current.items():
            if anew is not None and anew in ("", name):
                defined.pop(name, None)
            elif anew is not None and name not in defined:
                continue
            values = f"{prop.state} {dict(prop.values)} {prop.message}"
            if defined.get(name) != values:
                out.append(prop.changed() if name in defined else prop.defined())
                defined[name] = values
        if out:
            await line.send("".join(f"{element}\n" for element in out).encode())

    async def _take(self, element: Element, line: Line) -> None:
        """Do what a client asks."""
        if element.get("device", DEVICE) != DEVICE:
            return
        name = element.get("name", "")
        values = {(one.get("name") or ""): (one.text or "").strip() for one in element}
        match element.tag, name:
            case "getProperties", _:
                return await self._tell(line, name)
            case "newSwitchVector", "CONNECTION":
                self.connected = values.get("CONNECT", "Off") == "On" and values.get("DISCONNECT", "Off") != "On"
                self.refused = ""
            case "newSwitchVector", "ON_COORD_SET" if self.connected:
                self.on_set = next((n for n in ("TRACK", "SLEW", "SYNC") if values.get(n) == "On"), self.on_set)
            case "newSwitchVector", "TELESCOPE_ABORT_MOTION" if self.connected:
                self.telescope.stop(line.who)
            case "newNumberVector", "EQUATORIAL_EOD_COORD" if self.connected:
                self.refused = await self._go(values, line.who)
            case _:
                return None
        for client in list(self.clients):
            if client in self.clients:
                await self._tell(client)

    async def _go(self, values: dict[str, str], who: str) -> str:
        ra, dec = (sexagesimal(values.get(name, "")) for name in ("RA", "DEC"))
        if not (0.0 <= ra < 24.0 and -90.0 <= dec <= 90.0):
            return "RA is from 0 to 24 h, DEC from -90 to 90 degrees."
        place = from_mount_epoch(Pointing(ra * 15.0, dec, Epoch.DATE), self.telescope.now())
        order = self.telescope.sync if self.on_set == "SYNC" else self.telescope.goto
        return await verdict_of(order(place, who))


def _hours(place_deg: tuple[float, float]) -> dict[str, str | float]:
    return {"RA": place_deg[0] / 15.0, "DEC": place_deg[1]}


def sexagesimal(text: str) -> float:
    """A number as INDI's clients write it, ``-12.25`` or ``-12:15:00``; NaN when it is none."""
    parts = re.fullmatch(
        r"\s*([+-]?)(\d+(?:\.\d*)?(?:e[+-]?\d+)?)(?:[:; ](\d+(?:\.\d*)?))?(?:[:; ](\d+(?:\.\d*)?))?\s*", text
    )
    if parts is None or len(text) > 64:
        return math.nan
    sign, whole, minutes, seconds = parts.groups()
    value = float(whole) + float(minutes or 0) / 60.0 + float(seconds or 0) / 3600.0
    return -value if sign == "-" else value
