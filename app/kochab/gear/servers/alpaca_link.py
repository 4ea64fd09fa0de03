"""The Alpaca protocol of ASCOM over HTTP, and how its servers are found.

Written here on the standard library because every call must end in bounded time, the download of
a picture too; the usual client waits for that for ever. Facts: ASCOM Alpaca API reference, v1.
"""

import http.client
import json
import socket
from collections.abc import Mapping
from contextlib import suppress
from itertools import count
from time import monotonic
from typing import Any
from urllib.parse import urlencode

from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, PortError, RefusedError
from kochab.gear.servers.address import WORDS, NetAddress, making_sense, server_text, unreachable
from kochab.gear.servers.deadline_http import DeadlineConnection
from kochab.text.translation import tr_noop

PORT = 11111
ANSWER_S = 4.5
ANSWER_BYTES, LARGEST_BYTES = 256_000, 1_500_000_000  # of an answer, of a picture
DISCOVERY_PORT = 32227
QUESTION = b"alpacadiscovery1"

NOT_IMPLEMENTED = 0x400
NOT_CONNECTED = 0x407


class NotOfferedError(RefusedError):
    """The device does not have this property; what uses it goes without."""


class AlpacaLink:
    """One server, asked about devices of a ``kind``; the connection is kept open between calls.

    Not for several threads at once.
    """

    def __init__(self, address: NetAddress, kind: str = "camera") -> None:
        self._kind = kind
        self._address = address
        self._http = DeadlineConnection(address.host.strip("[]"), address.port)
        self._transaction = count(1)
        self._answered = False

    def get(self, path: str, limit_s: float = ANSWER_S, query: Mapping[str, object] | None = None) -> Any:
        """The value of a property, ``camera/0/gain`` for one, of what is in ``query`` where it depends on that."""
        return self._value(self.fetch(f"/api/v1/{path}", limit_s, query=query)[0])

    def put(self, path: str, values: Mapping[str, object], limit_s: float = ANSWER_S) -> None:
        """Set a property or call a method."""
        body = urlencode({**{k: str(v) for k, v in values.items()}, **self._ids()})
        kind = {"Content-Type": "application/x-www-form-urlencoded"}
        self._value(self._ask("PUT", f"/api/v1/{path}", limit_s, body, kind)[0])

    def devices(self) -> list[tuple[int, str]]:
        """Number and name of every device of this link's kind that the server has."""
        found = self._value(self.fetch("/management/v1/configureddevices", ANSWER_S)[0])
        with making_sense():
            return sorted(
                (int(d["DeviceNumber"]), server_text(str(d.get("DeviceName", self._kind))))
                for d in found
                if str(d.get("DeviceType", "")).lower() == self._kind
            )

    def fetch(
        self,
        path: str,
        limit_s: float,
        accept: str = "*/*",
        query: Mapping[str, object] | None = None,
        picture: bool = False,
    ) -> tuple[bytes, str]:
        """The bytes of an answer and their content type.

        Raises `PortError` when nobody listens, `LineLostError` when somebody did before and has gone, `NoAnswerError`
        when the answer is none that Alpaca knows.

        Parameters
        ----------
        path : str
            Of the resource on the server.
        limit_s : float
            The longest to wait.
        accept : str
            Content types wanted.
        query : Mapping[str, object] or None
            Arguments of the question.
        picture : bool
            Whether a large answer is taken.
        """
        asked = urlencode({**(query or {}), **self._ids()})
        return self._ask("GET", f"{path}?{asked}", limit_s, None, {"Accept": accept}, picture)

    def close(self) -> None:
        """Let the connection go."""
        self._http.close()

    def _ids(self) -> dict[str, str]:
        return {"ClientID": "6521", "ClientTransactionID": str(next(self._transaction))}

    def _ask(
        self, method: str, path: str, limit_s: float, body: str | None, headers: dict[str, str], picture: bool = False
    ) -> tuple[bytes, str]:
        # One deadline for the call and its second try: a server that trickles must not get the limit twice.
        self._http.deadline_s = monotonic() + limit_s
        kept = self._http.sock is not None
        try:
            try:
                return self._once(method, path, body, headers, picture)
            except (http.client.RemoteDisconnected, ConnectionResetError, BrokenPipeError):
                if not kept:
                    raise
                # a server may close a connection that was idle: that is no loss yet
                self._http.close()
                return self._once(method, path, body, headers, picture)
        except (OSError, http.client.HTTPException) as error:
            self._http.close()
            raise self._gone(error) from None

    def _once(
        self, method: str, path: str, body: str | None, headers: dict[str, str], picture: bool
    ) -> tuple[bytes, str]:
        self._http.request(method, path, body, headers)
        answer = self._http.getresponse()
        data = self._read(answer, picture)
        self._answered = True
        if answer.status != 200:
            text = " ".join(data.decode("utf-8", "replace").split())[:WORDS] or server_text(answer.reason)
            raise NoAnswerError(
                "{server} does not support this request: {text}.", server=self._address.server, text=text
            )
        return data, answer.headers.get("Content-Type") or ""

    def _read(self, answer: http.client.HTTPResponse, picture: bool) -> bytes:
        """The whole body, unless it is too large."""
        parts, size, most_bytes = [], 0, LARGEST_BYTES if picture else ANSWER_BYTES
        while part := answer.read1(min(most_bytes + 1, 1 << 20)):
            parts.append(part)
            size += len(part)
            if size > most_bytes:
                self._http.close()
                text = tr_noop("{server} never ends its reply.")
                if picture:
                    text = tr_noop("{server} sent too much data for an image.")
                raise NoAnswerError(text, server=self._address.server)
        # Bytes of Content-Length that never came.
        missing = answer.length
        answer.close()  # else the connection takes no further request
        if missing:
            raise ConnectionResetError
        return b"".join(parts)

    def _value(self, data: bytes) -> Any:
        try:
            reply = json.loads(data)
            number, message = int(reply.get("ErrorNumber", 0)), str(reply.get("ErrorMessage", ""))
        except (ValueError, AttributeError, TypeError, RecursionError):
            raise NoAnswerError("{server} is not an Alpaca server.", server=self._address.server) from None
        raise_refusal(number, message, self._kind)
        return reply.get("Value")

    def _gone(self, error: Exception) -> DeviceError:
        server = self._address.server
        if self._answered:
            return LineLostError("Lost the Alpaca server {server}. Check its computer.", server=server)
        if isinstance(error, http.client.HTTPException):
            return PortError("{server} is not an Alpaca server.", server=server)
        return unreachable(self._address, "Alpaca", error)


def raise_refusal(number: int, message: str, kind: str = "camera") -> None:
    """Raise what an Alpaca error number of a device of this ``kind`` means; 0 is none."""
    if number == 0:
        return
    text = server_text(" ".join(message[:WORDS].split()), WORDS).rstrip(".") or f"error {number:#x}"
    if number == NOT_CONNECTED:
        raise LineLostError("The {kind} is no longer connected to its server: {text}.", kind=kind, text=text)
    if number == NOT_IMPLEMENTED:
        raise NotOfferedError("The {kind} does not support this: {text}.", kind=kind, text=text)
    raise RefusedError("The {kind} refused: {text}.", kind=kind, text=text)


def discover(wait_s: float = 1.0) -> list[str]:
    """``host:port`` of every Alpaca server that answers a call on the local network (IPv4)."""
    found: list[str] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        for target in ("255.255.255.255", "127.0.0.1"):
            with suppress(OSError):  # no network at all, or no broadcast in it
                ear.sendto(QUESTION, (target, DISCOVERY_PORT))
        deadline = monotonic() + wait_s
        while (left := deadline - monotonic()) > 0:
            ear.settimeout(left)
            with suppress(OSError, ValueError, KeyError, TypeError):
                data, (host, _) = ear.recvfrom(1024)
                found.append(f"{host}:{int(json.loads(data)['AlpacaPort'])}")
    return list(dict.fromkeys(found))  # loopback and broadcast both find a server here
