"""Devices and networks: replies of mounts, camera servers' messages, requests to the phone page."""

import json
import math
import re
import select
import socket
import struct
import threading
from contextlib import closing, suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from random import Random

import numpy as np

from kochab.core.capture import CaptureSettings
from kochab.core.errors import DeviceError, FrameError, NoAnswerError
from kochab.core.mount import Direction, Epoch, Home, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import DRIVERS, serial_line
from kochab.gear.mounts.probe import probe_port
from kochab.gear.mounts.protocols import skywatcher
from kochab.gear.mounts.serial_line import ProtocolError, SerialLink, UdpPort
from kochab.simulate.responders import RESPONDERS
from tests.fuzz import mutate
from tests.fuzz.files import good, in_order
from tests.fuzz.target import Target, require, told
from tests.gear.mounts.bench import SITE, START
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.dialects import DIALECT_RESPONDERS, open_any

# -- Replies of mounts --------------------------------------------------------------------------

PROTOCOLS = ("ioptron", "lx200", "nexstar", "skywatcher")


@cache
def parsers() -> tuple:
    """Every parser of a reply of all protocols."""
    found = [import_module("kochab.gear.mounts.protocols").parse_accepted]
    for name in PROTOCOLS:
        module = import_module(f"kochab.gear.mounts.protocols.{name}")
        found += [f for n, f in vars(module).items() if n.startswith("parse_") and f.__module__ == module.__name__]
    return tuple(found)


def _replies(folder: Path) -> list[bytes]:
    return [
        b"05:30:00#", b"05:30.0#", b"12:34:56.7#", b"+05*23:28#", b"-05\xdf23'28#", b"123*45#", b"A", b"1", b"0", b"AT2#",
        b"Autostar#", b"||||   #", b"1below horizon#", b"E3#", b"nNpWTH#", b"+01.5#", b"22:10:11#", b"01/15/26#",
        b"+0194005000123456789 11#", b"+01940050012345678911#", b"0120", b"+122233344100000000200003#",
        b"+0600000000000000#", b"+060" + b"0" + b"0768000000000#", b"34AB0500,12CE0500#", b"34AB,12CE#", b"\x04\x15#",
        b"043707#", b"\x01#", b"@#", b"#", b"E#", b"\x30\x0b\x00\x00\x08\x1e\x00\x00#", b"\x16\x0a\x0b\x01\x0f\x1a\x01\x00#",
        b"NGM011000211#", b"029S0001000000#", b"10p 3        W00A#", b"2026-11-22#", b":CL1#", b"=563412\r", b"=101\r", b"!0\r", b"=\r", b"=020300\r",
    ]  # fmt: skip


def check_parsers(data: bytes, folder: Path) -> None:
    """Any bytes make a value that is in range, or a `ProtocolError`."""
    for parse in parsers():
        more = (b"@",) if parse.__name__ == "parse_echo" else ()
        with suppress(ProtocolError):
            # The mount's code is read from what parse_data gave.
            value = parse(skywatcher.parse_data(data) if parse.__name__ == "parse_mount_code" else data, *more)
            for number in value if isinstance(value, tuple) else (value,):
                require(not isinstance(number, float) or math.isfinite(number), f"{parse.__name__}: {value}")


class NoisyLink:
    """A line to a simulated mount whose replies are spoilt, each with some probability; nothing waits."""

    port, lossy = "noisy", False
    most = 4000  # bytes: a driver that asks for ever is a hang

    def __init__(self, driver: str, rng: Random, spoilt: float) -> None:
        self._mount = open_any(driver, BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, 20.0, self._now))
        self._rng, self._spoilt, self._buffer, self._elapsed_s, self.asked = rng, spoilt, bytearray(), 0.0, 0

    def _now(self) -> float:
        return START.timestamp() + self._elapsed_s if hasattr(self, "_elapsed_s") else START.timestamp()

    def clock(self):
        from datetime import UTC, datetime

        return datetime.fromtimestamp(self._now(), UTC)

    def write(self, data: bytes) -> None:
        self.asked += 1
        self._elapsed_s += 0.3
        require(self.asked < self.most, "it never stops asking")
        reply = self._mount.feed(bytes(data))
        if reply and self._rng.random() < self._spoilt:
            how = self._rng.random()
            reply = b"" if how < 0.15 else mutate.raw(self._rng, [reply])[:200] if how < 0.8 else _known(self._rng)
        self._buffer += reply

    def read_exact(self, count: int, timeout_s: float) -> bytes:
        return self._take(count if len(self._buffer) >= count else 0)

    def read_until(self, terminator: bytes, limit: int, timeout_s: float) -> bytes:
        end = self._buffer.find(terminator)
        return self._take(end + len(terminator) if 0 <= end < limit else 0)

    def _take(self, count: int) -> bytes:
        if not count:
            got = bytes(self._buffer[:24])
            self._buffer.clear()
            raise NoAnswerError(f"The answer on {self.port} stopped after {got!r}.")
        taken = bytes(self._buffer[:count])
        del self._buffer[:count]
        return taken

    def discard(self, quiet_s: float = 0.0) -> bytes:
        stale = bytes(self._buffer)
        self._buffer.clear()
        return stale

    def close(self) -> None:
        self._buffer.clear()


class NoisyWifi(UdpPort):
    """The Wi-Fi of a motor board: real datagrams, of which some are lost, late, doubled, empty or spoilt; nothing waits."""

    def __init__(self, board: NoisyLink, rng: Random) -> None:
        self._board, self._rng, self._came, self._late, self.waited_s = board, rng, b"", [], 0.0
        self._socket, self._far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for end in (self._socket, self._far):
            end.bind(("127.0.0.1", 0))
        self._socket.connect(self._far.getsockname())
        self._far.connect(self._socket.getsockname())

    def write(self, data: bytes) -> None:
        super().write(data)
        while select.select([self._far], [], [], 0.0)[0]:
            self._board.write(self._far.recv(2048))
            due, self._late = [*self._late, self._board.discard()], []
            match self._rng.randrange(12):
                case 0:
                    due.pop()
                case 1:
                    due, self._late = [], due
                case 2:
                    due *= 2
                case 3:
                    self._rng.shuffle(due := [*due, b"", _known(self._rng)])
                case 4:
                    due = [b"".join(due)]
            for datagram in due:
                self._far.send(datagram)

    def read(self, count: int, patience_s: float = 0.0) -> bytes:
        piece = super().read(count, 0.0)
        self.waited_s += 0.0 if piece else serial_line.SLICE_S
        return piece

    def close(self) -> None:
        self._socket.close()
        self._far.close()


def check_wifi(data: bytes, folder: Path) -> None:
    """A night over UDP: positions on the sky or one sentence, and it always comes to an end."""
    rng = Random(data)
    board = NoisyLink("skywatcher", rng, rng.choice((0.0, 0.05, 0.3)))
    port = NoisyWifi(board, rng)
    before = serial_line.UdpPort, serial_line.monotonic
    serial_line.UdpPort, serial_line.monotonic = (lambda address: port), (lambda: port.waited_s)
    try:
        with closing(port):  # a night that ends in a sentence closes no line
            _night(SerialLink("udp://127.0.0.1:11880"), "skywatcher", rng, board.clock)
    finally:
        serial_line.UdpPort, serial_line.monotonic = before


def _known(rng: Random) -> bytes:
    return rng.choice(_replies(Path()))


def check_driver(driver: str, data: bytes, folder: Path) -> None:
    """A night over a bad line: positions on the sky or one sentence, and it always comes to an end."""
    rng = Random(data)
    link = NoisyLink(driver, rng, rng.choice((0.02, 0.1, 0.3, 1.0)))
    _night(link, driver, rng, link.clock)


def _night(link, driver: str, rng: Random, clock) -> None:
    with told(DeviceError):
        mount = DRIVERS.load(driver)(link, site=SITE, clock=clock, home=rng.choice((None, Home.NOW)))
        with closing(mount):
            mount.epoch = rng.choice(list(Epoch))
            for _ in range(rng.randrange(3, 14)):
                with told(DeviceError):
                    _one_order(mount, rng)
            with told(DeviceError):
                mount.stop()
                mount.talk.read_pending()
            mount.watchdog.disarm()


def _one_order(mount, rng: Random) -> None:
    place, way = (rng.uniform(0, 360), rng.uniform(-89, 89)), rng.choice(list(Direction))
    match rng.randrange(10):
        case 0 | 1 | 2:
            here = mount.position()
            require(0 <= here.ra_deg <= 360 and abs(here.dec_deg) <= 90, f"{here} is not on the sky")
        case 3:
            mount.state()
        case 4:
            found = mount.altaz_deg()
            require(found is None or (abs(found[0]) <= 90 and abs(found[1]) <= 360), f"altitude, azimuth {found}")
        case 5:
            site = mount.site_report().site
            require(site is None or (abs(site.latitude_deg) <= 90 and abs(site.longitude_deg) <= 180), f"{site}")
        case 6:
            mount.sync(*place)
        case 7:
            mount.goto(*place)
        case 8:
            mount.pulse(way, 300) if rng.random() < 0.5 else mount.move(way, rng.choice((0.004, 1.0)), 0.2)
        case _:
            mount.track(rng.choice(tuple(TrackingRate)))


def check_probe(data: bytes, folder: Path) -> None:
    """Looking for a mount on a port where anything answers anything."""
    rng = Random(data)
    found = run(probe_port("noisy", lambda port, baud: NoisyLink(rng.choice(list(RESPONDERS)), rng, rng.random())))
    require(found.found or found.advice, "neither a mount nor advice")


def _number(rng: Random, seeds: mutate.Seeds) -> bytes:
    return rng.randbytes(8)


# -- Alpaca: bytes of an HTTP answer ------------------------------------------------------------

ALPACA = {
    "configureddevices": [{"DeviceName": "Sim", "DeviceType": "Camera", "DeviceNumber": 0, "UniqueID": "x"}],
    "name": "Sim", "sensortype": 2, "bayeroffsetx": 1, "bayeroffsety": 0, "maxadu": 65535, "exposuremin": 0.001,
    "exposuremax": 3600.0, "gainmin": 0, "gainmax": 300, "gain": 100, "gains": ["low", "high"], "maxbinx": 4, "binx": 1,
    "cameraxsize": 8, "cameraysize": 6, "imageready": True, "camerastate": 0, "lastexposureduration": 1.0,
    "lastexposurestarttime": "2026-01-15T22:00:00.123", "connected": True,
}  # fmt: skip


def _image_bytes(kind: int = 2, sent: int = 8) -> bytes:
    pixels = np.arange(48, dtype="<u2" if sent == 8 else "<i4").reshape(8, 6)
    return struct.pack("<11i", 1, 0, 1, 1, 44, kind, sent, 2, 8, 6, 0) + pixels.tobytes()


def _http(body: bytes, kind: str) -> bytes:
    head = f"HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\nServer: test\r\n\r\n"
    return head.encode() + body


def _alpaca(folder: Path) -> list[bytes]:
    value = json.dumps({"Value": [[1, 2], [3, 4]], "Type": 2, "Rank": 2, "ErrorNumber": 0, "ErrorMessage": ""}).encode()
    refused = json.dumps({"ErrorNumber": 1025, "ErrorMessage": "no such\nvalue", "Value": None}).encode()
    chunked = b'HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n{"a":\r\n2\r\n1}\r\n0\r\n\r\n'
    images = [_image_bytes(), _image_bytes(2, 2)]
    return [_http(value, "application/json"), _http(refused, "application/json"), chunked] + [
        _http(image, "application/imagebytes") for image in images
    ]


def _patched_http(link, answer) -> None:
    """Let the link's connections be socket pairs on which ``answer(request)`` lies ready."""

    def connected(address, timeout=None, source_address=None):
        near, far = socket.socketpair()
        near.settimeout(timeout)

        def serve() -> None:
            with far, suppress(OSError):
                request = far.recv(65536)
                far.sendall(answer(request))

        threading.Thread(target=serve, daemon=True).start()
        return near

    link._http._create_connection = connected


def check_http(data: bytes, folder: Path) -> None:
    """One answer of an Alpaca server, whatever it is: a value, a picture, or one sentence."""
    from kochab.gear.cameras.alpaca import image_of, sensor_numbers
    from kochab.gear.servers.address import NetAddress
    from kochab.gear.servers.alpaca_link import AlpacaLink

    link = AlpacaLink(NetAddress("127.0.0.1", 11111))
    _patched_http(link, lambda request: data)
    with closing(link), told(DeviceError):
        body, kind = link.fetch("/api/v1/camera/0/imagearray", 2.0)
        with told(DeviceError):
            rows = sensor_numbers(image_of(body, kind), 65535)
            require(rows.ndim in (2, 3) and rows.size > 0, f"a picture of {rows.shape}")
        with told(DeviceError):
            link._value(body)


def check_alpaca(data: bytes, folder: Path) -> None:
    """A camera whose server tells odd values: opened, exposed and closed, or one sentence."""
    from kochab.gear.cameras.alpaca import AlpacaCamera
    from kochab.gear.servers.alpaca_link import AlpacaLink

    values = json.loads(data)

    def fetch(self, path: str, limit_s: float, accept: str = "*/*"):
        name = path.rpartition("/")[2]
        if name == "imagearray":
            return _image_bytes(), "application/imagebytes"
        if name not in values:
            return json.dumps({"ErrorNumber": 0x400, "ErrorMessage": "no"}).encode(), "application/json"
        return json.dumps({"Value": values[name], "ErrorNumber": 0}).encode(), "application/json"

    before = AlpacaLink.fetch, AlpacaLink.put
    AlpacaLink.fetch, AlpacaLink.put = fetch, lambda self, path, told, limit_s=5.0: None
    try:
        with told(DeviceError):
            camera = AlpacaCamera.open("127.0.0.1:11111", CaptureSettings())
            with closing(camera):
                frame = camera.next_frame(0.01)
                if frame is not None:
                    in_order(frame)
                with told(DeviceError):
                    camera.configure(CaptureSettings(exposure_s=0.5, gain=10.0, binning=2))
    finally:
        AlpacaLink.fetch, AlpacaLink.put = before


def _alpaca_values(rng: Random, seeds: mutate.Seeds) -> bytes:
    root = json.loads(rng.choice(seeds))
    for _ in range(rng.choice(mutate.ONCE_OR_MORE)):
        root = mutate._changed(rng, root)
    return json.dumps(root if isinstance(root, dict) else {"name": root}).encode()


# -- INDI: a picture in a message, and the messages of a server -----------------------------------


def check_blob(data: bytes, folder: Path) -> None:
    """A BLOB: its suffix in the first line, its bytes after it."""
    from kochab.gear.cameras.indi import frame_of

    suffix, _, blob = data.partition(b"\n")
    with told(FrameError):
        in_order(frame_of(blob, suffix.decode("latin-1"), "CCD 7"))


def _blobs(folder: Path) -> list[bytes]:
    import zlib

    named = [(".fits", good()["headed.fits"]), (".fits.z", zlib.compress(good()["a.fits"])), (".jpg", good()["a.jpg"])]
    return [suffix.encode() + b"\n" + blob for suffix, blob in named]


def _indi(folder: Path) -> list[bytes]:
    import base64

    from tests.gear.cameras.test_indi_hostile import BLOB, CAMERA

    picture = base64.b64encode(good()["a.fits"]).decode()
    size = len(good()["a.fits"])
    blob = BLOB.replace('size="9"', f'size="{size}"') + picture + "</oneBLOB></setBLOBVector>"
    return [(CAMERA + blob).encode()]


def check_indi(data: bytes, folder: Path) -> None:
    """Any stream from a server: a camera and perhaps a picture, or one sentence, in bounded time."""
    from kochab.gear.cameras import open_camera
    from kochab.gear.servers import indi_link

    limits = {indi_link: {"TELL_S": 0.3, "MORE_S": 0.05, "POWER_UP_S": 0.3, "SET_S": 0.3, "CONNECT_S": 1.0}}
    before = {module: {name: getattr(module, name) for name in names} for module, names in limits.items()}
    for module, names in limits.items():
        vars(module).update(names)
    try:
        with socket.create_server(("127.0.0.1", 0)) as ear:
            threading.Thread(target=_serve, args=(ear, data), daemon=True).start()
            with told(DeviceError, FrameError):
                camera = open_camera("indi", f"127.0.0.1:{ear.getsockname()[1]}/C", CaptureSettings(exposure_s=0.05))
                with closing(camera):
                    frame = camera.next_frame(0.2)
                    if frame is not None:
                        in_order(frame)
    finally:
        for module, names in before.items():
            vars(module).update(names)


_RANGE = 'format="%g" min="0" max="0" step="0"'
_ABOUT = 'device="T" state="Ok" perm="rw"'
_TELESCOPE = "".join(
    f'<def{kind}Vector {_ABOUT} name="{name}" {more}>'
    + "".join(
        f'<def{kind} name="{member}" {_RANGE if kind == "Number" else ""}>{value}</def{kind}>'
        for member, value in members
    )
    + f"</def{kind}Vector>"
    for kind, name, more, members in (
        ("Text", "DRIVER_INFO", "", [("DRIVER_INTERFACE", 1)]),
        ("Switch", "CONNECTION", 'rule="OneOfMany"', [("CONNECT", "On"), ("DISCONNECT", "Off")]),
        ("Number", "EQUATORIAL_EOD_COORD", "", [("RA", "5.5"), ("DEC", "-5:23:28")]),
        ("Switch", "ON_COORD_SET", 'rule="OneOfMany"', [("TRACK", "On"), ("SYNC", "Off")]),
        ("Switch", "TELESCOPE_ABORT_MOTION", 'rule="AtMostOne"', [("ABORT", "Off")]),
        ("Switch", "TELESCOPE_TRACK_STATE", 'rule="OneOfMany"', [("TRACK_ON", "On"), ("TRACK_OFF", "Off")]),
        ("Number", "GEOGRAPHIC_COORD", "", [("LAT", 47.5), ("LONG", 8.5), ("ELEV", 400)]),
        ("Text", "TIME_UTC", "", [("UTC", "2026-01-15T22:10:11"), ("OFFSET", "1.00")]),
        ("Number", "POLLING_PERIOD", "", [("PERIOD_MS", 100)]),
    )
)
_REPORTS = (
    '<setNumberVector device="T" name="EQUATORIAL_EOD_COORD" state="Busy"><oneNumber name="RA">5.6</oneNumber>'
    '<oneNumber name="DEC">10</oneNumber></setNumberVector><setTextVector device="T" name="TIME_UTC" state="Ok">'
    '<oneText name="UTC">2026-01-15T22:10:12</oneText><oneText name="OFFSET">1</oneText></setTextVector>'
    '<message device="T" message="[ERROR] below the horizon"/>'
)


def check_indi_mount(data: bytes, folder: Path) -> None:
    """Any stream from a server: a telescope whose reports are in range, or one sentence, in bounded time."""
    from kochab.gear.mounts.drivers import indi
    from kochab.gear.servers import indi_link

    short = {
        "TELL_S": 0.3,
        "MORE_S": 0.05,
        "POWER_UP_S": 0.3,
        "SET_S": 0.2,
        "CONNECT_S": 1.0,
        "CALL_S": 0.5,
        "STOP_S": 0.2,
    }
    before = {
        module: {name: vars(module)[name] for name in short if name in vars(module)} for module in (indi, indi_link)
    }
    for module, names in before.items():
        vars(module).update({name: short[name] for name in names})
    try:
        with socket.create_server(("127.0.0.1", 0)) as ear, told(DeviceError):
            threading.Thread(target=_serve, args=(ear, data), daemon=True).start()
            with closing(indi.IndiMount(f"127.0.0.1:{ear.getsockname()[1]}", site=SITE)) as mount:
                _reports(mount)
                with told(DeviceError):
                    mount.stop()
    finally:
        for module, names in before.items():
            vars(module).update(names)


def _reports(mount) -> None:
    """What a mount tells is on the sky and on the Earth."""
    with told(DeviceError):
        here = mount.position()
        require(0 <= here.ra_deg <= 360 and abs(here.dec_deg) <= 90, f"{here} is not on the sky")
    with told(DeviceError):
        mount.state()
    with told(DeviceError):
        found = mount.altaz_deg()
        require(found is None or (abs(found[0]) <= 90 and abs(found[1]) <= 360), f"altitude, azimuth {found}")
    with told(DeviceError):
        report = mount.site_report()
        site = report.site
        require(site is None or (abs(site.latitude_deg) <= 90 and abs(site.longitude_deg) <= 180), f"{site}")
        require(site is None or math.isfinite(site.height_m), f"{site}")
        require(report.time_utc is None or report.time_utc.tzinfo is not None, "a clock without a zone")


TELESCOPE = {
    "configureddevices": [{"DeviceName": "Sim", "DeviceType": "Telescope", "DeviceNumber": 0, "UniqueID": "x"}],
    "name": "Sim", "connected": True, "canpulseguide": True, "cansettracking": True, "canslewasync": True, "cansync": True,
    "canpark": True, "trackingrates": [0, 1], "trackingrate": 0, "equatorialsystem": 1, "rightascension": 5.5,
    "declination": -5.4, "slewing": False, "atpark": False, "tracking": True, "sideofpier": 0, "altitude": 40.0,
    "azimuth": 180.0, "sitelatitude": 47.5, "sitelongitude": 8.5, "siteelevation": 400.0, "alignmentmode": 2,
    "utcdate": "2026-01-15T22:10:11.123Z", "destinationsideofpier": 1, "interfaceversion": 3,
}  # fmt: skip


def check_alpaca_mount(data: bytes, folder: Path) -> None:
    """A telescope whose server tells odd values: its reports are in range, or one sentence."""
    from kochab.gear.mounts.drivers.alpaca import AlpacaMount
    from kochab.gear.servers.alpaca_link import AlpacaLink

    rng, values = Random(data), json.loads(data)

    def fetch(self, path: str, limit_s: float, accept: str = "*/*", query=None):
        name = path.rpartition("/")[2]
        answer = (
            {"Value": values[name], "ErrorNumber": 0}
            if name in values
            else {"ErrorNumber": 0x400, "ErrorMessage": "no"}
        )
        return json.dumps(answer).encode(), "application/json"

    before = AlpacaLink.fetch, AlpacaLink.put
    AlpacaLink.fetch, AlpacaLink.put = fetch, lambda self, path, told, limit_s=5.0: None
    try:
        with told(DeviceError), closing(AlpacaMount("127.0.0.1:11111/0", site=SITE)) as mount:
            _reports(mount)
            for _ in range(4):
                with told(DeviceError):
                    _one_order(mount, rng)
            with told(DeviceError):
                mount.stop()
            mount.watchdog.disarm()
    finally:
        AlpacaLink.fetch, AlpacaLink.put = before


def _serve(ear: socket.socket, data: bytes) -> None:
    with suppress(OSError):
        while True:
            line, _ = ear.accept()
            threading.Thread(target=_tell, args=(line, data), daemon=True).start()


def _tell(line: socket.socket, data: bytes) -> None:
    with line, suppress(OSError):
        line.settimeout(3.0)
        line.recv(1000)
        line.sendall(data)
        while line.recv(65536):
            pass


# -- Requests to the phone page -----------------------------------------------------------------

PHONE = [
    b"GET /token/ HTTP/1.1\r\nHost: x\r\n\r\n",
    b"GET /token/now.json HTTP/1.1\r\nHost: x\r\n\r\n",
    b"POST /token/ HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc",
]


def check_phone(data: bytes, folder: Path) -> None:
    """A whole reply to any request; the page to nobody without the token."""
    from types import SimpleNamespace

    from kochab.server.phone_page import PhonePage, _Server
    from kochab.workflows.session.alignment_state import AlignmentState

    page = PhonePage("token")
    page.show(AlignmentState(words="turn the altitude bolt"))
    reply = _Server._reply(SimpleNamespace(_answer=page.answer), data)
    head, _, body = reply.partition(b"\r\n\r\n")
    require(re.match(rb"HTTP/1\.1 (200|400|404|501) ", head), f"{head[:80]!r}")
    require(f"Content-Length: {len(body)}".encode() in head, "another length than told")
    require(not (b" 200 " in head[:20] and b"/token/" not in data), "the page without its token")


TARGETS = [
    Target("serial reply", _replies, check_parsers, mutate.raw, 60_000, 200),
    *(
        Target(f"mount {name}", lambda folder: [b""], partial(check_driver, name), _number, 4000, 3)
        for name in (*RESPONDERS, *DIALECT_RESPONDERS)
    ),
    Target("mount over UDP", lambda folder: [b""], check_wifi, _number, 4000, 3),
    Target("mount probe", lambda folder: [b""], check_probe, _number, 3000, 3),
    Target("Alpaca answer", _alpaca, check_http, mutate.raw, 8000, 10),
    Target("Alpaca camera", lambda folder: [json.dumps(ALPACA).encode()], check_alpaca, _alpaca_values, 5000, 10),
    Target("INDI picture", _blobs, check_blob, mutate.raw, 2000, 3, sandboxed="frame.jpg"),
    Target("INDI messages", _indi, check_indi, mutate.raw, 150, 1),
    Target("INDI telescope", lambda folder: [(_TELESCOPE + _REPORTS).encode()], check_indi_mount, mutate.raw, 150, 1),
    Target(
        "Alpaca telescope",
        lambda folder: [json.dumps(TELESCOPE).encode()],
        check_alpaca_mount,
        _alpaca_values,
        5000,
        10,
    ),
    Target("phone request", lambda folder: PHONE, check_phone, mutate.raw, 8000, 20),
]
