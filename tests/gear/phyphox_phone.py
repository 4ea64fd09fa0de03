"""A phone that runs phyphox with remote access on, written from phyphox's own sources and from nothing that reads it.

[api] phyphox/phyphox-docs, docs/remote-interface/openapi.yaml (version 1.1.0), the authority, and index.md beside it.
[android] phyphox/phyphox-android, RemoteServer.java, ExperimentTimeReference.java, SensorInput.java.
[ios] phyphox/phyphox-ios, ExperimentWebServer.swift, ExperimentTimeReference.swift.
[file] phyphox/phyphox-experiments, gyroscope.phyphox and accelerometer.phyphox: titles, buffers, export sets.
[config] an iPhone's answers: LaurentBerger/phyphox-py, tests/config_1.bin and tests/meta_1.bin.
[cdd] Android Compatibility Definition, 7.3.9, C-2-3, of a phone's gyroscope: noise of at most 0.014, better 0.007
deg/s/sqrt(Hz), rate random walk below 0.001 deg/s*sqrt(Hz), calibration within 0.002 rad/s (0.115 deg/s), a range of 1000
deg/s or more and 16 counts a deg/s or more. A Bosch BMI160, as in many phones: range 2000 deg/s, 16.4 counts a deg/s there.
"""

import json
import math
import threading
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from urllib.parse import parse_qsl, urlsplit

import numpy as np
from scipy.spatial.transform import Rotation

AXES = ("x", "y", "z", "abs", "t")  # in the order of [android] handleConfig
_GYROSCOPE = ("gyrX", "gyrY", "gyrZ", "gyr", "gyr_time")
_ACCELEROMETER = ("accX", "accY", "accZ", "acc", "acc_time")


def _raw(quantity: str, absolute: str, unit: str, names: tuple[str, ...]) -> dict[str, list[tuple[str, str]]]:
    labels = ("Time (s)", *(f"{quantity} {axis} ({unit})" for axis in "xyz"), f"{absolute} ({unit})")
    return {"Raw Data": list(zip(labels, (names[4], *names[:4]), strict=True))}


# Title, its German, the buffers of each sensor's axes, the sets to export: label, buffer. Somebody made the third.
EXPERIMENTS: dict[str, tuple[str, str, dict[str, tuple[str, ...]], dict[str, list[tuple[str, str]]]]] = {
    "gyroscope": (
        "Gyroscope (rotation rate)",
        "Gyroskop (Drehrate)",
        {"gyroscope": _GYROSCOPE},
        _raw("Gyroscope", "Absolute", "rad/s", _GYROSCOPE),
    ),
    "acceleration": (
        "Acceleration with g",
        "Beschleunigung mit g",
        {"accelerometer": _ACCELEROMETER},
        _raw("Acceleration", "Absolute acceleration", "m/s^2", _ACCELEROMETER),
    ),
    "two sensors": (
        "Mast",
        "Mast",
        {"accelerometer": ("a1", "a2", "a3", "", "ta"), "gyroscope": ("w1", "w2", "w3", "", "time of w")},
        {"Force": [("Time (s)", "ta"), ("Up", "a3")]},
    ),
}


class PhyphoxPhone:
    """Samples ``attitude()``, the matrix from directions of an inertial frame to the phone's axes, and serves what its
    gyroscope says: the rotation since the sample before, over the time between, so that rates times differences of
    time add up to the turn. On that ``scale``, ``bias_deg_s`` (each second it walks by ``bias_walk`` deg/s, as the root
    of the time) and white noise of a one-sided density: at 100 Hz its sigma is the density times sqrt(50 Hz).
    ``step_deg_s`` is the gyroscope's least count (1 / 16.4 at the full range of [cdd]'s example), none at 0.

    May be set at any time: ``measuring``, as a finger on the phone would; ``says``, bytes that replace every answer;
    ``refuses``, and no start succeeds; ``lag_s``, after which a start or stop that was answered takes effect ([android]
    looks every 0.4 s what it is to do); ``bias_deg_s``, where NaN makes values that are none."""

    def __init__(
        self,
        attitude: Callable[[], np.ndarray],
        *,
        rate_hz: float = 100.0,
        seed: int = 1,
        noise_deg_s_rt_hz: float = 0.007,
        bias_deg_s: tuple[float, float, float] = (0.11, -0.07, 0.04),
        bias_walk: float = 0.0003,
        scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
        range_deg_s: float = 2000.0,
        step_deg_s: float = 0.0,
        flavour: str = "android",
        measuring: bool = False,
    ) -> None:
        self.attitude, self.rate_hz, self.scale, self.range_deg_s = attitude, rate_hz, np.array(scale), range_deg_s
        self.noise_deg_s_rt_hz, self.bias_walk, self.step_deg_s = noise_deg_s_rt_hz, bias_walk, step_deg_s
        self.bias_deg_s = np.array(bias_deg_s)
        self.android, self.says, self.refuses = flavour == "android", None, False
        self.lag_s, self._intent = 0.0, (math.inf, False)  # when to start or stop
        self.requests: list[str] = []  # the paths that were asked for, with their queries
        self._random, self._lock = np.random.default_rng(seed), threading.RLock()
        self._awake, self._away, self._port = threading.Event(), threading.Event(), 0
        self.switch("gyroscope")
        self.measuring = measuring

    # What people do with the phone.

    def switch(self, experiment: str) -> None:
        """Opens another experiment: another session, other buffers, nothing measured."""
        with self._lock:
            self.title, self.local_title, self.inputs, self.export = EXPERIMENTS[experiment]
            self.buffers: dict[str, list[float]] = {n: [] for names in self.inputs.values() for n in names if n}
            # [android] %06x, [ios] decimal: 24 bits of a clock
            self.session = format(time.time_ns() & 0xFFFFFF, "06x" if self.android else "d")
            self._events: list[tuple[str, float, float, float]] = []  # event, experiment time, clock, system time
            self._full_next = False

    def clear(self) -> None:
        """Presses delete: stops, empties the buffers, and experiment time begins anew."""
        with self._lock:
            self._events.clear()
            for values in self.buffers.values():
                values.clear()
            self._full_next = (
                True  # [android] forceFullUpdate: the next answer carries whole buffers, whatever was asked
            )

    @property
    def measuring(self) -> bool:
        with self._lock:
            return bool(self._events) and self._events[-1][0] == "START"

    @measuring.setter
    def measuring(self, on: bool) -> None:
        with self._lock:
            if on != self.measuring:
                now = time.perf_counter()
                self._events.append(("START" if on else "PAUSE", self._experiment_time(now), now, time.time()))

    def silent(self, on: bool = True) -> None:
        """While on, connections are accepted and none is answered; who waits then is hung up on."""
        (self._awake.clear if on else self._awake.set)()

    def pull(self, *_: object) -> None:
        """The phone goes away: its port is closed, and nothing is sampled."""
        if self._away.is_set():
            return
        self._away.set()
        self._awake.set()
        self._server.shutdown()
        self._server.server_close()
        for thread in self._threads:
            thread.join()

    __exit__ = pull

    def back(self) -> "PhyphoxPhone":
        """It is there again, at the same address."""
        self._away.clear()
        self._awake.set()
        self._server = HTTPServer(("127.0.0.1", self._port), self._handler())
        self._port = self._server.server_port
        self.address = f"127.0.0.1:{self._port}"
        serve = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._threads = [serve, threading.Thread(target=self._sample, daemon=True)]
        for thread in self._threads:
            thread.start()
        return self

    __enter__ = back

    # Its sensors.

    def _experiment_time(self, clock: float) -> float:
        """Seconds since the first start without the pauses, [android] getExperimentTimeFromEvent."""
        if not self._events:
            return 0.0
        event, at, since, _ = self._events[-1]
        return at if event == "PAUSE" else at + max(clock - since, 0.0)

    def _look(self) -> tuple[float, np.ndarray]:
        before = time.perf_counter()
        attitude = np.array(self.attitude(), float)
        return (before + time.perf_counter()) / 2.0, attitude

    def _sample(self) -> None:
        before, was = self._look()
        due = before + 1.0 / self.rate_hz
        while not self._away.wait(due - time.perf_counter()):
            now, attitude = self._look()
            due = max(due + 1.0 / self.rate_hz, now + 0.5 / self.rate_hz)
            rate = self._rate(-Rotation.from_matrix(attitude @ was.T).as_rotvec(), now - before)
            before, was = now, attitude
            force = 9.81 * attitude[:, 2] + self._random.normal(0.0, 0.01, 3)
            with self._lock:
                if now >= self._intent[0]:
                    self.measuring, self._intent = self._intent[1], (math.inf, False)
                if self.measuring:
                    for source, names in self.inputs.items():
                        values = rate if source == "gyroscope" else force
                        row = [*values, math.hypot(*values), self._experiment_time(now)]
                        for name, value in zip(names, row, strict=True):
                            if name:
                                self.buffers[name].append(float(value))

    def _rate(self, turn: np.ndarray, dt: float) -> np.ndarray:
        # in place: what a test sets in this moment would be lost otherwise
        self.bias_deg_s += self._random.normal(0.0, self.bias_walk * math.sqrt(dt), 3)
        noise = self._random.normal(0.0, self.noise_deg_s_rt_hz / math.sqrt(2.0 * dt), 3)
        rate = np.degrees(turn / dt) * self.scale + self.bias_deg_s + noise
        if self.step_deg_s:
            rate = np.round(rate / self.step_deg_s) * self.step_deg_s
        return np.array(np.radians(np.clip(rate, -self.range_deg_s, self.range_deg_s)))

    # Its server.

    def _handler(phone) -> type[BaseHTTPRequestHandler]:  # noqa: N805
        class Handler(BaseHTTPRequestHandler):
            protocol_version, timeout = "HTTP/1.1", 2.0

            def do_GET(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                phone.requests.append(self.path)
                self.close_connection = True
                if not phone._awake.is_set():
                    phone._awake.wait()
                    return
                status, kind, answer = phone._answer(self.path, self.headers.get("Content-Type") or "", body)
                if phone.says is not None:
                    status, answer = 200, phone.says
                self.send_response(status)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(answer)))
                self.send_header("Access-Control-Allow-Origin", "*")
                self.send_header("Connection", "close")
                with suppress(ConnectionError):  # who asked has gone
                    self.end_headers()
                    self.wfile.write(answer)

            do_POST = do_GET  # noqa: N815

            def log_message(self, *_: object) -> None:
                pass

        return Handler

    def _answer(self, target: str, kind: str, body: bytes) -> tuple[int, str, bytes]:
        url = urlsplit(target)
        try:
            asked = self._parameters(url.query, kind, body)
        except ValueError:
            return _json({"error": "Malformed request body."}, 400)
        with self._lock:
            match url.path:
                case "/get":
                    return self._get(asked)
                case "/control":
                    return _json({"result": self._control(asked)})
                case "/config":
                    return _json(self._config())
                case "/time":
                    keys = ("event", "experimentTime", "systemTime")
                    return _json([dict(zip(keys, (e, at, now), strict=True)) for e, at, _, now in self._events])
                case "/meta":
                    return _json(self._meta())
        if url.path == "/" or self.android:  # [android] its HTTP library serves what it does not know from "/"
            return 200, "text/html", b"<!DOCTYPE html><html><head><title>phyphox</title></head><body></body></html>"
        return 404, "text/html", b""

    def _parameters(self, query: str, kind: str, body: bytes) -> dict[str, str]:
        """Of the body and of the query; the body wins, and of one name the first. Raises ValueError on bad JSON."""
        pairs = parse_qsl(query, keep_blank_values=True)
        if kind.lower().startswith("application/json"):
            found = json.loads(body)
            if not isinstance(found, dict):
                raise ValueError("not an object")
            given = {k: "" if v is None else v if isinstance(v, str) else json.dumps(v) for k, v in found.items()}
            pairs = [*given.items(), *pairs]
        elif kind.lower().startswith("application/x-www-form-urlencoded"):
            pairs = [*parse_qsl(body.decode(), keep_blank_values=True), *pairs]
        return dict(reversed(pairs))

    def _get(self, asked: dict[str, str]) -> tuple[int, str, bytes]:
        found: list[tuple[str, str, list[float]]] = []
        for name, value in asked.items():
            mode, least, reference = "single", math.nan, name
            if value == "full" or (value and self._full_next):
                mode = "full"
            elif value:
                mode, (number, bar, other) = "partial", value.partition("|")
                reference = other if bar else name
                try:
                    least = float(number)
                except ValueError:
                    if self.android or name in self.buffers:
                        return _json({"error": "Invalid threshold."}, 400)
                if math.isfinite(least) and least:  # of 8 digits, up by one in the last place
                    least += 10.0 ** math.floor(math.log10(abs(least) / 1e7))
            if name not in self.buffers:
                continue
            if reference not in self.buffers:
                return _json({"error": "Unknown reference buffer."}, 400)
            values, against = self.buffers[name], self.buffers[reference]
            if mode == "single":
                values = values[-1:] or [math.nan]
            elif mode == "partial":  # [android] skips what is not above, which NaN is not; [ios] takes what is
                pairs = zip(values, against, strict=False)
                values = [v for v, r in pairs if (not r <= least if self.android else r > least)]
            found.append((name, mode, values))
        self._full_next = self._full_next and self.android and not asked
        status = {"session": self.session, "measuring": self.measuring, "timedRun": False, "countDown": 0}
        write = _eight_digits if self.android else _all_digits
        texts = (
            f'"{name}":{{"size":0,"updateMode":"{mode}", "buffer":[{",".join(write(v) for v in values)}]}}'
            for name, mode, values in found
        )
        text = '{"buffer":{\n' + ",\n".join(texts) + '\n},\n"status":' + json.dumps(status) + "\n}\n"
        return 200, "application/json", text.encode()

    def _control(self, asked: dict[str, str]) -> bool:
        match asked.get("cmd"):
            case "start" | "stop" as command if command == "stop" or not self.refuses:
                self._intent = (time.perf_counter() + self.lag_s, command == "start")
                if not self.lag_s:
                    self.measuring, self._intent = command == "start", (math.inf, False)
            case "clear":
                self.clear()
            case "set" if asked.get("buffer") in self.buffers:
                try:
                    value = float(asked.get("value", ""))
                except ValueError:
                    return False
                if math.isfinite(value):
                    self.buffers[asked["buffer"]].append(value)
                return math.isfinite(value)
            case _:
                return False
        return True

    def _config(self) -> dict[str, object]:
        names = list(self.buffers)
        if not self.android:
            names.sort(key=lambda name: zlib.crc32(name.encode()))  # [api] in no order
        inputs = [
            {"source": source, "outputs": [{axis: name} for axis, name in zip(AXES, outputs, strict=True) if name]}
            for source, outputs in self.inputs.items()
        ]
        export = [
            {"set": name, "sources": [{"label": label, "buffer": buffer} for label, buffer in rows]}
            for name, rows in self.export.items()
        ]
        return {
            "crc32": format(zlib.crc32(self.title.encode()), "x"),  # stands for that of the file
            "title": self.title,
            "localTitle": self.title if self.android else self.local_title,
            "category": "Raw Sensors",
            "localCategory": "Raw Sensors" if self.android else "Sensoren",
            "buffers": [{"name": name, "size": 0} for name in names],
            "inputs": inputs,
            "export": export,
        }

    def _meta(self) -> dict[str, object]:
        """[android] leaves out what it does not know and has sensors, [ios] sends null and has none."""
        if not self.android:
            lacking = ("deviceBaseOS", "deviceBoard", "deviceCodename", "deviceManufacturer", "depthBackRate")
            known = {"version": "1.2.0", "build": "17272", "fileFormat": "1.19", "deviceModel": "iPhone14,5"}
            return {**known, "deviceBrand": "Apple", "deviceRelease": "18.6.2", **dict.fromkeys(lacking)}
        gyroscope = {"Name": "BMI160 gyroscope", "Vendor": "BOSCH", "Range": repr(math.radians(self.range_deg_s))}
        known = {"version": "1.2.0", "fileFormat": "1.19", "deviceModel": "Phone", "deviceBrand": "Maker"}
        return {**known, "sensors": {"gyroscope": gyroscope, "humidity": {}}}


def _json(answer: object, status: int = 200) -> tuple[int, str, bytes]:
    return status, "application/json", json.dumps(answer, ensure_ascii=False).encode()


def _eight_digits(value: float) -> str:
    """[android] DecimalFormat "0.#######E0": 1.2345678E-2, 3E0, and null for what is no number."""
    if not math.isfinite(value):
        return "null"
    digits, _, power = f"{value:.7e}".partition("e")
    return f"{digits.rstrip('0').rstrip('.')}E{int(power)}"


def _all_digits(value: float) -> str:
    """[ios] what JSONSerialization writes; null as there."""
    return repr(value) if math.isfinite(value) else "null"
