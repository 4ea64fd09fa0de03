"""The telescope as an ASCOM Alpaca device: ITelescopeV4 over HTTP, its management, and discovery by UDP 32227.

Coordinates are of date (``EquatorialSystem`` 1, topocentric). What no camera or guard offers (guiding, moving an axis,
parking) is refused as "not implemented", as the standard wants it. V4 only adds to V3, whose programs set ``Connected``
and read each property by itself, as before. Facts: ASCOM Alpaca API Reference 12 and Platform 7's ``ITelescopeV4``; the
error numbers and which parameters a method takes are those of their published tables.
"""

import json
import socket
import threading
import time
from collections.abc import Callable, Mapping
from datetime import UTC
from http import HTTPStatus
from itertools import count
from typing import Any

from kochab.core import __version__
from kochab.core.attitude import unit_vectors
from kochab.core.errors import KochabError
from kochab.core.mount import Epoch, Pointing
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.server.alpaca_words import (
    ACTION_NOT_IMPLEMENTED,
    INVALID_OPERATION,
    INVALID_VALUE,
    METHODS,
    NOT_CONNECTED,
    NOT_IMPLEMENTED,
    VALUE_NOT_SET,
    WRONG_METHOD,
    BadRequest,
    Fault,
    Json,
    envelope,
    number,
    truth,
    whole,
)
from kochab.server.http_server import HttpServer, Request, Response
from kochab.server.telescope.listening import Ports
from kochab.sky.horizon import NO_AIR, Horizon, sidereal_deg
from kochab.text.translation import tr
from kochab.workflows.telescope.offered import OfferedTelescope, Seen

PORT, DISCOVERY_PORT = 11111, 32227
DISCOVERY = b"alpacadiscovery1"
WHO = "Alpaca"
VERDICT_S, SLEW_S = 8.0, 600.0

CONSTANT: Mapping[str, Any] = {
    "alignmentmode": 1,
    "athome": False,
    "atpark": False,
    **dict.fromkeys(
        (
            "canfindhome", "canpark", "canpulseguide", "cansetdeclinationrate", "cansetguiderates", "cansetpark",
            "cansetpierside", "cansetrightascensionrate", "cansettracking", "canslewaltaz", "canslewaltazasync",
            "cansyncaltaz", "canunpark",
        ),
        False,
    ),
    **dict.fromkeys(("canslew", "canslewasync", "cansync"), True),
    "declinationrate": 0.0,
    "rightascensionrate": 0.0,
    "doesrefraction": False,
    "equatorialsystem": 1,
    "tracking": True,
    "trackingrate": 0,
    "trackingrates": [0],
    "description": "Where the camera or the mount points, by Kochab",
    "driverinfo": f"Kochab {__version__}",
    "driverversion": __version__.rpartition(".")[0] or __version__,
    "interfaceversion": 4,
    "name": "Kochab",
    "supportedactions": [],
}  # fmt: skip
"""What does not change, by its name in the address."""
ABSENT = frozenset(
    {
        "aperturearea", "aperturediameter", "focallength", "guideratedeclination", "guideraterightascension",
        "ispulseguiding", "sideofpier", "slewsettletime", "siteelevation", "sitelatitude", "sitelongitude", "altitude",
        "azimuth", "siderealtime", "destinationsideofpier", "findhome", "moveaxis", "park", "pulseguide", "setpark",
        "slewtoaltaz", "slewtoaltazasync", "synctoaltaz", "unpark", "commandblind", "commandbool", "commandstring",
        "setupdialog", "action",
        *(name for name in CONSTANT if name in ("declinationrate", "rightascensionrate", "doesrefraction", "tracking")),
    }
)  # fmt: skip
"""What there is in the standard and not here; of what can be read, the writing of it."""
ANYTIME = frozenset({"connect", "connected", "connecting", "disconnect", "description", "driverinfo", "driverversion",
                     "interfaceversion", "name", "action", "supportedactions"})  # fmt: skip
"""What is answered without a connection."""
STATE = ("Altitude", "AtHome", "AtPark", "Azimuth", "Declination", "IsPulseGuiding", "RightAscension", "SideOfPier",
         "SiderealTime", "Slewing", "Tracking", "UTCDate")  # fmt: skip
"""The operational properties of a telescope; ``DeviceState`` tells those that there are, under these names."""


def listen(ports: Ports, port: int) -> int:
    """Offer it at a port, 0 for any, and return that; PortError when it cannot be had."""
    ports.others.append(device := AlpacaTelescope(ports.telescope, ports.host, port))
    return device.port


class AlpacaTelescope:
    """The device, at a port of ``host`` until :meth:`stop`; PortError when it cannot be had.

    Parameters
    ----------
    telescope : OfferedTelescope
        What it is.
    host : str
        The address to listen at.
    port : int
        The port, 0 for any.
    discovery_port : int
        Where it is looked for by UDP.
    """

    def __init__(
        self, telescope: OfferedTelescope, host: str, port: int = PORT, discovery_port: int = DISCOVERY_PORT
    ) -> None:
        self._telescope = telescope
        self._connected: set[str] = set()
        self._target: dict[str, float] = {}
        self._numbers = count(1)
        self._gets: dict[str, Callable[[], Any]] = {
            "declination": lambda: self._here()[1],
            "rightascension": lambda: self._here()[0] / 15.0,
            "slewing": lambda: self._seen().slewing,
            "targetdeclination": lambda: self._wanted("targetdeclination"),
            "targetrightascension": lambda: self._wanted("targetrightascension"),
            "utcdate": lambda: f"{telescope.now().astimezone(UTC):%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z",
        }
        if telescope.site is not None:
            self._gets |= {
                "sitelatitude": lambda: self._site.latitude_deg,
                "sitelongitude": lambda: self._site.longitude_deg,
                "siteelevation": lambda: self._site.height_m,
                "siderealtime": lambda: sidereal_deg(self._site, telescope.now()) % 360.0 / 15.0,
                "altitude": lambda: self._altaz_deg()[0],
                "azimuth": lambda: self._altaz_deg()[1],
            }
        self._server = HttpServer(self.answer, host, port)
        self.port = self._server.address[1]
        self._discovery = _Discovery(telescope, host, self.port, discovery_port)

    def stop(self) -> None:
        """Close the ports."""
        self._discovery.stop()
        self._server.stop()
        if self._connected:
            self._connected.clear()
            self._telescope.leave(WHO)

    # -- HTTP --------------------------------------------------------------------------------------

    def answer(self, request: Request) -> Response:
        """The answer to any request."""
        if request.method not in METHODS:
            return WRONG_METHOD
        parts = request.path.strip("/").split("/")
        given = request.form if request.method == "PUT" else {name.lower(): v for name, v in request.query.items()}
        try:
            match parts:
                case ["management", *rest] if request.method == "GET":
                    return self._json(given, self._management(rest))
                case ["api", "v1", "telescope", "0", name] if name == name.lower():
                    return self._device(request.method, name, given)
                case ["setup", *_]:
                    return Response(f"Kochab {__version__}\n".encode(), "text/plain; charset=utf-8")
        except BadRequest as error:
            return Response(f"{error}\n".encode(), "text/plain; charset=utf-8", HTTPStatus.BAD_REQUEST)
        return Response(b"There is no such device or method.\n", "text/plain", HTTPStatus.BAD_REQUEST)

    def _management(self, rest: list[str]) -> Any:
        match rest:
            case ["apiversions"]:
                return [1]
            case ["v1", "description"]:
                return {
                    "ServerName": "Kochab",
                    "Manufacturer": "Kochab",
                    "ManufacturerVersion": __version__,
                    "Location": "",
                }
            case ["v1", "configureddevices"]:
                unique = f"kochab-{socket.gethostname()}-{self.port}"
                return [{"DeviceName": "Kochab", "DeviceType": "Telescope", "DeviceNumber": 0, "UniqueID": unique}]
        raise BadRequest("No such management call.")

    def _device(self, method: str, name: str, given: Mapping[str, str]) -> Response:
        """One member of the interface; a fault of the device is an answer too."""
        whole(given, "ClientID" if method == "PUT" else "clientid")
        try:
            if name not in ANYTIME and not self._connected:
                raise Fault(NOT_CONNECTED, "Not connected.")
            value = self._get(name, given) if method == "GET" else self._put(name, given)
        except Fault as fault:
            return self._json(given, None, fault)
        except KochabError as error:
            return self._json(given, None, Fault(INVALID_OPERATION, str(error)))
        return self._json(given, value)

    def _json(self, given: Mapping[str, str], value: Any, fault: Fault | None = None) -> Response:
        return envelope(given, next(self._numbers), value, fault)

    # -- ITelescopeV4 ------------------------------------------------------------------------------

    def _get(self, name: str, given: Mapping[str, str]) -> Any:
        if name == "connected":
            return bool(self._connected)
        if name == "connecting":
            return False  # "connect" has connected when it comes back
        if name == "devicestate":
            return self._state()
        if name in ("axisrates", "canmoveaxis"):
            if whole(given, "axis", None) not in (0, 1, 2):
                raise Fault(INVALID_VALUE, "Axis is 0, 1 or 2.")
            return [] if name == "axisrates" else False
        if name == "destinationsideofpier":
            number(given, "rightascension"), number(given, "declination")
        if name in CONSTANT:
            return CONSTANT[name]
        if name in self._gets:
            return self._gets[name]()
        if name in ABSENT:
            raise Fault(NOT_IMPLEMENTED, f"{name} is not implemented.")
        raise BadRequest(f"There is no property {name}.")

    def _state(self) -> list[Json]:
        """What a program would else ask one by one; what there is not, or not yet, is left out."""
        states = []
        for name in STATE:
            try:
                states.append({"Name": name, "Value": self._get(name.lower(), {})})
            except Fault:
                continue
        return [*states, {"Name": "TimeStamp", "Value": self._gets["utcdate"]()}]

    def _put(self, name: str, given: Mapping[str, str]) -> Any:
        match name:
            case "connected":
                return self._connect(truth(given, "Connected"), given.get("ClientID", "0"))
            case "connect" | "disconnect":
                return self._connect(name == "connect", given.get("ClientID", "0"))
            case "action":
                raise Fault(ACTION_NOT_IMPLEMENTED, "There are no actions.")
            case "abortslew":
                return self._telescope.stop(WHO)
            case "targetrightascension":
                return self._aim("targetrightascension", number(given, "TargetRightAscension"), 0.0, 24.0)
            case "targetdeclination":
                return self._aim("targetdeclination", number(given, "TargetDeclination"), -90.0, 90.0)
            case "slewtocoordinates" | "slewtocoordinatesasync" | "synctocoordinates":
                ra, dec = number(given, "RightAscension"), number(given, "Declination")
                self._aim("targetrightascension", ra, 0.0, 24.0)
                self._aim("targetdeclination", dec, -90.0, 90.0)
                return self._order(name)
            case "slewtotarget" | "slewtotargetasync" | "synctotarget":
                return self._order(name)
            case "trackingrate":
                if number(given, "TrackingRate") != 0.0:
                    raise Fault(INVALID_VALUE, "Sidereal is the one rate.")
                return None
        if name in ABSENT or name in self._gets:
            raise Fault(NOT_IMPLEMENTED, f"{name} is not implemented.")
        raise BadRequest(f"There is no method {name}.")

    def _connect(self, wanted: bool, client: str) -> None:
        before = bool(self._connected)
        if wanted:
            if len(self._connected) < 100:
                self._connected.add(client)
        else:
            self._connected.discard(client)
        if bool(self._connected) != before:
            (self._telescope.leave if before else self._telescope.join)(WHO)

    def _aim(self, name: str, value: float, low: float, high: float) -> None:
        # 24 h is no right ascension, 90 degrees is a declination.
        if not low <= value <= high or (high == 24.0 and value == high):
            raise Fault(INVALID_VALUE, f"{value:g} is not from {low:g} to {high:g}.")
        self._target[name] = value

    def _wanted(self, name: str) -> float:
        if name not in self._target:
            raise Fault(VALUE_NOT_SET, "No target was set.")
        return self._target[name]

    def _order(self, name: str) -> None:
        """A slew or a sync to the target, of date; a slew without "async" comes back when it is over."""
        ra_deg, dec_deg = self._wanted("targetrightascension") * 15.0, self._wanted("targetdeclination")
        telescope = self._telescope
        place = from_mount_epoch(Pointing(ra_deg, dec_deg, Epoch.DATE), telescope.now())
        verdict = (telescope.sync if name.startswith("sync") else telescope.goto)(place, WHO)
        try:
            why = verdict.result(VERDICT_S)
        except TimeoutError:
            # Taken back, or on the wire already: then its word is waited for, for it may move.
            why = tr("The mount does not answer.") if verdict.cancel() else verdict.result()
        if why:
            raise Fault(INVALID_OPERATION, why)
        if name in ("slewtocoordinates", "slewtotarget"):
            until = time.monotonic() + SLEW_S
            while (seen := telescope.seen) is not None and seen.slewing and time.monotonic() < until:
                time.sleep(0.1)

    def _seen(self) -> Seen:
        if (seen := self._telescope.seen) is None:
            raise Fault(VALUE_NOT_SET, "Nothing was solved yet, and no mount has answered.")
        return seen

    def _here(self) -> tuple[float, float]:
        return to_mount_epoch(*self._seen().icrs_deg, Epoch.DATE, self._telescope.now())

    def _altaz_deg(self) -> tuple[float, float]:
        horizon = Horizon(self._site, self._telescope.now(), NO_AIR)
        return horizon.altaz_deg(unit_vectors(*self._seen().icrs_deg))

    @property
    def _site(self) -> Any:
        return self._telescope.site


class _Discovery:
    """Answers who looks for Alpaca devices with our port: this computer alone, or whoever reaches ``host``."""

    def __init__(self, telescope: OfferedTelescope, host: str, port: int, discovery_port: int) -> None:
        self._local, self._port = host.startswith("127."), port
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._over = threading.Event()
        # Several programs may answer on one computer, says the standard.
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.settimeout(0.5)
        try:
            self._socket.bind(("", discovery_port))  # a broadcast reaches no socket that is bound to one address
        except OSError as error:
            telescope.say(tr("Alpaca cannot be discovered: {why}.", why=error.strerror or error))
            self._over.set()
        self._thread = threading.Thread(target=self._run, name="kochab-alpaca-discovery", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Answer no more."""
        self._over.set()
        self._thread.join(2.0)
        self._socket.close()

    def _run(self) -> None:
        while not self._over.is_set():
            try:
                data, sender = self._socket.recvfrom(64)
                if data.startswith(DISCOVERY) and (not self._local or sender[0].startswith("127.")):
                    self._socket.sendto(json.dumps({"AlpacaPort": self._port}).encode(), sender)
            except OSError:  # nobody asked, or the asker is gone
                continue
