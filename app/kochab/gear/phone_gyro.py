"""A phone's gyroscope, read from the free app phyphox with its remote access switched on.

The phone serves HTTP on the local network, as long as the app shows its experiment; nothing goes anywhere else. Which
buffers hold the rates is asked (``/config``), so that any experiment with a gyroscope does. Source: phyphox's own
``openapi.yaml``, remote interface 1.1.0. Its server takes one request at a time and closes each connection; numbers
come with eight digits, ``null`` stands for none.

Rates are of the phone against the stars, in its axes: x to the right of the screen, y up, z out of it.
"""

import http.client
from collections import deque
from time import monotonic
from typing import Any
from urllib.parse import quote

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError
from kochab.core.values import frozen
from kochab.gear.servers.address import making_sense, net_address, unreachable
from kochab.gear.servers.deadline_http import DeadlineConnection
from kochab.parsing.text_input import TextError, parse_json

PORT = 80
"""An iPhone's, which its address leaves out; Android shows 8080."""
ANSWER_S, MOST_BYTES = 2.5, 2_000_000
MOST_S = 900.0
"""Seconds after which the phone's recording is cleared: about 100,000 samples."""
CLOCKS_S = 20.0
"""For so long the quickest answer tells how the phone's clock stands to ours."""
STALE_S = 1.0
"""Nothing new for so long, though it measures: its time may have begun anew."""
SOURCE, AXES = "gyroscope", ("t", "x", "y", "z")


@frozen(eq=False)
class Rates:
    """What was measured: moments (N,) of the phone's clock, s, and rates (N, 3), rad/s about the phone's axes.

    ``ahead_s`` is to be added for :func:`time.monotonic`; ``anew`` when what came between this and the last is missing.
    """

    at_s: Floats
    rates: Floats
    ahead_s: float
    anew: bool


class PhoneGyro:
    """Asks the phone at ``address`` (``HOST:PORT`` as it shows it) for its gyroscope, and begins measuring.

    Raises `PortError` when nobody is there, `NoAnswerError` when it is no phyphox with a gyroscope.
    """

    def __init__(self, address: str) -> None:
        self._where = net_address(address, PORT)
        self._answered = False
        self._names = self._gyroscope()
        self._session: object = None
        self._newest: float | None = None
        self._heard_s = monotonic()
        self._clocks: deque[tuple[float, float]] = deque()
        with making_sense():
            measuring = self._ask(f"/get?{quote(self._names[0])}")["status"]["measuring"]
            if not measuring and not self._ask("/control?cmd=start")["result"]:
                raise NoAnswerError("The phone did not begin to measure. Press start in phyphox.")

    def close(self) -> None:
        """Nothing is kept open."""

    def rates(self) -> Rates:
        """What was measured since the last call.

        Raises `NoAnswerError` when it does not measure or says something else, `LineLostError` when it is gone.
        """
        time, *axes = (quote(name) for name in self._names)
        since = "" if self._newest is None else f"={self._newest:.9g}"
        wanted = "&".join([time + since, *(f"{axis}{since and since + '%7C' + time}" for axis in axes)])
        answer = self._ask(f"/get?{wanted}")
        now = monotonic()
        try:
            columns = [answer["buffer"][name]["buffer"] for name in self._names]
            session, measuring = answer["status"]["session"], answer["status"]["measuring"]
            fewest = min(map(len, columns))  # the server may be writing while it answers
            table = np.array([column[:fewest] for column in columns], dtype=np.float64).reshape(len(AXES), fewest)
        except (KeyError, TypeError, ValueError):
            self._names = self._gyroscope()  # another experiment may call them otherwise
            raise self._no_gyroscope() from None
        anew = self._newest is None
        if session != self._session or not measuring or now - self._heard_s > STALE_S:
            self._session, anew = session, True
            self._forget_time()  # another experiment, a pause, or a measurement that was cleared: its time begins anew
        if not measuring:
            raise NoAnswerError("The phone is paused. Press start in phyphox.")
        table = table[:, np.isfinite(table).all(axis=0)]
        if not table.size:
            return Rates(np.zeros(0), np.zeros((0, 3)), 0.0, anew)
        self._newest, self._heard_s = float(table[0, -1]), now
        if self._clocks and now - self._newest > self._clocks[-1][1] + STALE_S:
            self._clocks.clear()  # a pause that nobody saw: its clock stood still
            anew = True
        self._clocks.append((now, now - self._newest))
        while now - self._clocks[0][0] > CLOCKS_S:
            self._clocks.popleft()
        return Rates(table[0], table[1:].T, min(ahead for _, ahead in self._clocks), anew)

    def renew(self) -> None:
        """Let the phone forget what it has measured, when that has become much: it keeps all, and slows down."""
        if self._newest is not None and self._newest > MOST_S:
            for command in ("clear", "start"):
                self._ask(f"/control?cmd={command}")
            self._forget_time()

    def _forget_time(self) -> None:
        self._newest, self._heard_s = None, monotonic()
        self._clocks.clear()

    def _gyroscope(self) -> list[str]:
        """The buffers of time, x, y and z."""
        try:
            for source in self._ask("/config")["inputs"]:
                if source["source"] == SOURCE:
                    names = {axis: str(name) for output in source["outputs"] for axis, name in output.items()}
                    return [names[axis] for axis in AXES]
        except (KeyError, TypeError, AttributeError):
            pass
        raise self._no_gyroscope()

    def _no_gyroscope(self) -> NoAnswerError:
        return NoAnswerError(
            "{server} shows no gyroscope. Open “Gyroscope (rotation rate)” in phyphox, with remote access on.",
            server=self._where.server,
        )

    def _ask(self, path: str) -> Any:
        http_line = DeadlineConnection(self._where.host.strip("[]"), self._where.port)
        http_line.deadline_s = monotonic() + ANSWER_S
        try:
            http_line.request("GET", path, headers={"Connection": "close"})
            reply = http_line.getresponse()
            body = reply.read(MOST_BYTES)
            if reply.status != http.client.OK:
                raise self._no_gyroscope()
            answer = parse_json(body)
        except TextError:
            raise self._no_gyroscope() from None
        except (OSError, http.client.HTTPException) as error:
            raise self._gone(error) from None
        finally:
            http_line.close()
        if not isinstance(answer, dict):
            raise self._no_gyroscope()
        self._answered = True
        return answer

    def _gone(self, error: Exception) -> DeviceError:
        if self._answered:
            return LineLostError("Lost the phone at {server}. Keep phyphox open.", server=self._where.server)
        if isinstance(error, http.client.HTTPException):
            return self._no_gyroscope()
        return unreachable(self._where, "phyphox", error, "remote access")
