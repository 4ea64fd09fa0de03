"""A small ASCOM Alpaca server with one telescope, after ASCOM's API reference (Device API v1, ITelescopeV3)."""

import json
import threading
from contextlib import contextmanager
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from urllib.parse import parse_qsl, urlsplit

from kochab.core.mount import Direction, PierSide, TrackingRate

NOT_IMPLEMENTED, INVALID_VALUE, NOT_CONNECTED, PARKED, INVALID_OPERATION = 0x400, 0x401, 0x407, 0x408, 0x40B
RATES = tuple(TrackingRate)[1:]  # DriveRates, from 0: sidereal, lunar, solar, King
GUIDES = (Direction.NORTH, Direction.SOUTH, Direction.EAST, Direction.WEST)  # GuideDirections, from 0


class Refused(Exception):  # noqa: N818
    def __init__(self, number, message):
        super().__init__(message)
        self.number = number


class AlpacaTelescope:
    """The device over a bench telescope: its members by their Alpaca names."""

    def __init__(self, telescope):
        self.telescope = telescope
        self.connected = False
        self.rate = RATES[0]
        self.absent = set()  # members that this driver does not implement
        self.fixed = {
            "name": "Bench Telescope",
            "interfaceversion": 3,
            "alignmentmode": 2,
            "equatorialsystem": 1,
            "cansync": True,
            "canslew": True,
            "canslewasync": True,
            "canpulseguide": True,
            "cansettracking": True,
            "siteelevation": 100.0,
        }

    def get(self, member, told):
        if member == "connected":
            return self.connected
        if member in self.fixed and member not in self.absent:
            return self.fixed[member]
        read = getattr(self, f"get_{member}", None)
        if read is None or member in self.absent:
            raise Refused(NOT_IMPLEMENTED, f"{member} is not implemented")
        if not self.connected:
            raise Refused(NOT_CONNECTED, "The telescope is not connected")
        return read(**told)

    def put(self, member, told):
        if member == "connected":
            self.connected = told["Connected"].lower() == "true"
            return
        do = getattr(self, f"put_{member}", None)
        if do is None or member in self.absent:
            raise Refused(NOT_IMPLEMENTED, f"{member} is not implemented")
        if not self.connected:
            raise Refused(NOT_CONNECTED, "The telescope is not connected")
        do(**told)

    def get_rightascension(self):
        return self.telescope.believed_deg()[0] / 15.0

    def get_declination(self):
        return self.telescope.believed_deg()[1]

    def get_slewing(self):
        return self.telescope.slewing

    def get_tracking(self):
        return self.telescope.tracking

    def get_atpark(self):
        return self.telescope.parked

    def get_sideofpier(self):
        return {PierSide.EAST: 0, PierSide.WEST: 1}[self.telescope.pier_side]

    def get_destinationsideofpier(self, rightascension, declination):
        east = (self.telescope.sidereal_deg() - float(rightascension) * 15.0 + 180.0) % 360.0 < 180.0
        return 1 if east else 0  # what is in the east is looked at from the west of the pier

    def get_sitelatitude(self):
        return self.telescope.latitude_deg

    def get_sitelongitude(self):
        return self.telescope.longitude_deg

    def get_utcdate(self):
        return datetime.fromtimestamp(self.telescope.now_unix(), UTC).strftime("%Y-%m-%dT%H:%M:%S.%f0Z")

    def get_trackingrates(self):
        return [0, 1, 2, 3]

    def get_trackingrate(self):
        return RATES.index(self.rate)

    def put_trackingrate(self, TrackingRate):
        self.rate = RATES[int(TrackingRate)]
        self.put_tracking(str(self.telescope.tracking))

    def put_tracking(self, Tracking):
        self._unparked()
        self.telescope.tracking_deg_s = self.rate.deg_s if Tracking.lower() == "true" else 0.0

    def put_slewtocoordinatesasync(self, RightAscension, Declination):
        self._unparked()
        self._tracks()
        reason = self.telescope.goto(*self._place(RightAscension, Declination))
        if reason:
            raise Refused(INVALID_OPERATION, reason)

    def put_synctocoordinates(self, RightAscension, Declination):
        self._unparked()
        self._tracks()
        self.telescope.sync(*self._place(RightAscension, Declination))

    def put_abortslew(self):
        self._unparked()
        self.telescope.stop()

    def put_pulseguide(self, Direction, Duration):
        self._unparked()
        self.telescope.pulse(GUIDES[int(Direction)], int(Duration))

    def _place(self, hours, degrees):
        hours, degrees = float(hours), float(degrees)
        if not (0.0 <= hours < 24.0 and -90.0 <= degrees <= 90.0):
            raise Refused(INVALID_VALUE, f"{hours}, {degrees} is no place on the sky")
        return hours * 15.0, degrees

    def _unparked(self):
        if self.telescope.parked:
            raise Refused(PARKED, "The telescope is parked")

    def _tracks(self):
        if not self.telescope.tracking:
            raise Refused(INVALID_OPERATION, "Tracking is off")


@contextmanager
def alpaca_server(device):
    """Serve ``device`` as telescope 0 on a port of loopback; the server, whose ``port`` is told."""
    numbers = count(1)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self):
            self._answer(dict(parse_qsl(urlsplit(self.path).query)), lambda member, told: device.get(member, told))

        def do_PUT(self):
            body = self.rfile.read(int(self.headers["Content-Length"])).decode()
            self._answer(dict(parse_qsl(body)), device.put)

        def _answer(self, told, do):
            path = urlsplit(self.path).path
            ids = {name.lower(): told.pop(name) for name in list(told) if name.lower().startswith("client")}
            if self.command == "GET":
                told = {name.lower(): value for name, value in told.items()}  # its names are in any case
            reply = {
                "ClientTransactionID": int(ids.get("clienttransactionid", 0)),
                "ServerTransactionID": next(numbers),
            }
            reply |= {"ErrorNumber": 0, "ErrorMessage": ""}
            kind, _, member = path.removeprefix("/api/v1/telescope/").partition("/")
            try:
                if path == "/management/v1/configureddevices":
                    name = device.fixed["name"]
                    reply["Value"] = [
                        {"DeviceName": name, "DeviceType": "Telescope", "DeviceNumber": 0, "UniqueID": "t0"},
                        {"DeviceName": "A camera", "DeviceType": "Camera", "DeviceNumber": 0, "UniqueID": "c0"},
                    ]
                elif kind != "0" or not member:
                    self._send(400, b"No such device", "text/plain")
                    return
                else:
                    value = do(member, told)
                    if self.command == "GET":
                        reply["Value"] = value
            except Refused as error:
                reply |= {"ErrorNumber": error.number, "ErrorMessage": str(error)}
            except (TypeError, ValueError, KeyError) as error:
                self._send(400, str(error).encode(), "text/plain")
                return
            self._send(200, json.dumps(reply).encode(), "application/json")

        def _send(self, code, data, kind):
            self.send_response(code)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    server.port = server.server_address[1]
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
