"""A small ASCOM Alpaca server with one camera, on loopback, whose cable can be pulled."""

import json
import socket
import struct
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlparse

import numpy as np


class Refused(Exception):  # noqa: N818
    def __init__(self, number, message):
        super().__init__(message)
        self.number = number


class AlpacaCameraSimulator:
    """The device: its properties by their Alpaca names, and faults a test switches on."""

    def __init__(self, width=64, height=40):
        self.width, self.height = width, height
        self.values = {
            "connected": False,
            "name": "Sim Camera",
            "sensortype": 0,
            "maxadu": 65535,
            "exposuremin": 0.001,
            "exposuremax": 3600.0,
            "gainmin": 0,
            "gainmax": 300,
            "gain": 100,
            "maxbinx": 4,
            "binx": 1,
            "biny": 1,
            "cameraxsize": width,
            "cameraysize": height,
            "numx": width,
            "numy": height,
            "startx": 0,
            "starty": 0,
            "camerastate": 0,
            "bayeroffsetx": 0,
            "bayeroffsety": 0,
        }
        self.started = None
        self.image_bytes = True
        self.element = 2  # Int32, as ASCOM has it
        self.transmitted = np.dtype("<u2")
        self.unplugged = False
        self.fails = ""
        self.aborts = 0
        self.picture = None
        self.hang = threading.Event()
        self.hang.set()
        self.cut = False

    def pixels(self):
        """[x][y], each pixel different: x + 1000 y."""
        if self.picture is not None:
            return self.picture
        binned = self.values["binx"]
        x, y = np.indices((self.width // binned, self.height // binned))
        return (x + 1000 * y).astype(np.int32)

    def get(self, name):
        if self.unplugged:
            raise Refused(0x407, "The USB cable was pulled")
        if name == "imageready":
            if self.fails:
                raise Refused(0x500, self.fails)
            return self.started is not None and time.monotonic() >= self.started[0] + self.started[2]
        if name == "lastexposurestarttime":
            return self.started[1].replace(tzinfo=None).isoformat()
        if name == "lastexposureduration":
            return self.started[2]
        if name not in self.values:
            raise Refused(0x400, f"{name} is not implemented")
        return self.values[name]

    def put(self, name, given):
        if self.unplugged:
            raise Refused(0x407, "The USB cable was pulled")
        if name == "startexposure":
            self.started = (time.monotonic(), datetime.now(UTC), float(given["Duration"]))
        elif name == "abortexposure":
            self.aborts += 1
            self.started = None
        else:
            (value,) = (v for k, v in given.items() if k.lower() == name)
            self.values[name] = value == "True" if name == "connected" else int(value)

    def image(self):
        array = self.pixels()
        if not self.image_bytes:
            told = {"Type": 2, "Rank": array.ndim, "Value": array.tolist(), "ErrorNumber": 0}
            return json.dumps({**told, "ErrorMessage": ""}).encode(), "application/json"
        codes = {"<i2": 1, "<i4": 2, "<f8": 3, "|u1": 6, "<u2": 8}
        kind = codes[self.transmitted.str]
        sides = [*array.shape, 0][:3]
        header = struct.pack("<11i", 1, 0, 1, 1, 44, self.element, kind, array.ndim, *sides)
        data = header + array.astype(self.transmitted).tobytes()
        return data[: len(data) // 2] if self.cut else data, "application/imagebytes"


class AlpacaServer:
    """Serves ``camera`` at :attr:`address` until :meth:`stop`."""

    def __init__(self, camera):
        self.camera = camera
        handler = type("Handler", (_Handler,), {"camera": camera})
        self._server = _Quiet(("127.0.0.1", 0), handler)
        self._open = []
        self.port = self._server.server_address[1]
        self.address = f"127.0.0.1:{self.port}"
        self._server.connections = self._open
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()

    def stop(self):
        """As if its computer was switched off: what is open breaks."""
        self._server.shutdown()
        self._thread.join()
        for line in self._open:
            with suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)
        self.camera.hang.set()
        self._server.server_close()


class _Quiet(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request, client_address):
        """Lines that break are what is tested."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def setup(self):
        super().setup()
        self.server.connections.append(self.connection)

    def log_message(self, *args):
        pass

    def do_GET(self):
        path = urlparse(self.path).path
        if path == "/management/v1/configureddevices":
            camera = {"DeviceName": "Sim Camera", "DeviceType": "Camera", "DeviceNumber": 0}
            wheel = {"DeviceName": "Wheel", "DeviceType": "FilterWheel", "DeviceNumber": 0}
            return self._value([wheel, {**camera, "UniqueID": "1"}])
        name = path.rpartition("/")[2]
        if name == "imagearray":
            self.camera.hang.wait(60)
            if "imagebytes" not in self.headers.get("accept", ""):
                self.camera.image_bytes = False
            data, kind = self.camera.image()
            return self._send(200, data, kind)
        return self._answer(lambda: self.camera.get(name))

    def do_PUT(self):
        body = self.rfile.read(int(self.headers.get("Content-Length", 0))).decode()
        given = {k: v[0] for k, v in parse_qs(body).items()}
        given = {k: v for k, v in given.items() if not k.startswith("Client")}
        return self._answer(lambda: self.camera.put(self.path.rpartition("/")[2], given))

    def _answer(self, ask):
        if not self.path.startswith("/api/v1/camera/0/"):
            return self._send(400, b"no such device", "text/plain")
        try:
            return self._value(ask())
        except Refused as refusal:
            return self._value(None, refusal.number, str(refusal))

    def _value(self, value, number=0, message=""):
        told = {"Value": value, "ErrorNumber": number, "ErrorMessage": message}
        told |= {"ClientTransactionID": 1, "ServerTransactionID": 1}
        return self._send(200, json.dumps(told).encode(), "application/json; charset=utf-8")

    def _send(self, status, data, kind):
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        with suppress(OSError):
            self.wfile.write(data)
