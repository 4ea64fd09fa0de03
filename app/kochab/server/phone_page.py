"""The alignment on a phone: one read-only page over the local network, off until switched on.

GET only, two addresses under a random token, no files, no query. Without the token every request gets 404. Nothing
is sent anywhere by itself. One thread serves all connections, so that slow or hostile ones cost nobody else
anything: a request has one deadline, and when there are too many connections the oldest makes room for the newest.
"""

import asyncio
import json
import secrets
import socket
import threading
import time
from collections.abc import Callable
from hmac import compare_digest
from html import escape
from http import HTTPStatus
from typing import Any

from kochab.core.errors import PortError
from kochab.folders import data_folder
from kochab.polar.error import Knob, PolarError, angle_in_words, cure
from kochab.text.translation import tr
from kochab.workflows.session.alignment_state import AlignmentState
from kochab.workflows.telescope.push_to import PushTo, phone_json

TOKEN_BYTES = 16  # 128 bits: nobody in the network guesses the address
REQUEST_S = 10.0
"""For a connection from its beginning to the last byte of the reply: one sent letter by letter ends too."""
MOST_CONNECTIONS = 32
LONGEST_REQUEST = 8192  # bytes
HEADERS = (
    "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n"
    "Content-Security-Policy: default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline';"
    " connect-src 'self'\r\nConnection: close\r\n"
)


class PhonePage:
    """Serves the newest state; :meth:`show` may be called from any thread, at any rate.

    How old it is by ``now``, the clock that the window goes by, is told whenever a phone asks: a window that hangs does
    not keep its last number young.
    """

    def __init__(self, token: str | None = None, now: Callable[[], float] = time.monotonic) -> None:
        self._token = token or secrets.token_urlsafe(TOKEN_BYTES)
        self._state: AlignmentState | PushTo = AlignmentState()
        self._now = now
        self._server: _Server | None = None

    @property
    def url(self) -> str:
        """What a phone opens; empty while switched off."""
        if self._server is None:
            return ""
        host, port = self._server.address
        return f"http://{host}:{port}/{self._token}/"

    def start(self, host: str | None = None, port: int = 0) -> str:
        """Switch on, at the address this computer has on the local network, and return the URL.

        Raises `PortError` when the address or port cannot be used.
        """
        if self._server is None:
            address = host or local_address()
            try:
                self._server = _Server(socket.create_server((address, port)), self.answer)
            except OSError as error:
                raise PortError(
                    "Can't serve the phone page at {address}: {strerror}.",
                    address=address,
                    strerror=error.strerror or error,
                ) from None
        return self.url

    def stop(self) -> None:
        """Switch off; the port is closed at once."""
        server, self._server = self._server, None
        if server is not None:
            server.stop()

    def show(self, state: AlignmentState | PushTo) -> None:
        """Replace what phones see: what to do, and the error once both bolts are known."""
        self._state = state

    def answer(self, path: str) -> tuple[str, bytes] | None:
        """Content type and body for a path; None for whatever is not there."""
        parts = path.split("/")
        # Compared in constant time: the answer's delay does not tell how many letters were right.
        if len(parts) != 3 or parts[0] or not compare_digest(parts[1].encode(), self._token.encode()):
            return None
        if parts[2] == "":
            page = (data_folder("resources") / "phone.html").read_text(encoding="utf-8")
            for place, text in texts(isinstance(self._state, PushTo)).items():
                page = page.replace(f"{{{place}}}", escape(text))
            return "text/html; charset=utf-8", page.encode("utf-8")
        if parts[2] == "now.json":
            return "application/json", json.dumps(self._fields(self._now())).encode("utf-8")
        return None

    def _fields(self, now_s: float) -> dict[str, Any]:
        state = self._state
        return phone_json(state, now_s) if isinstance(state, PushTo) else state_json(state, now_s)


def texts(push: bool = False) -> dict[str, str]:
    """The page's own texts in the person's language, by the places in it."""
    return {
        "language": tr("en", "the language's code, as a web page gives it"),
        "title": tr("Push-to") if push else tr("Polar alignment"),
        "unsolved": tr("No solution for the newest frame yet."),
        "unconnected": tr("No connection to Kochab."),
    }


class _Server:
    """Answers requests at ``listener`` in one thread of its own until it is stopped."""

    def __init__(self, listener: socket.socket, answer: Callable[[str], tuple[str, bytes] | None]) -> None:
        self.address: tuple[str, int] = listener.getsockname()[:2]
        self._listener, self._answer = listener, answer
        self._connections: dict[asyncio.StreamWriter, None] = {}  # the oldest first
        self._over = asyncio.Event()
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop = self._runner.get_loop()  # made here, so that it can be stopped at any time
        self._thread = threading.Thread(target=self._run, name="kochab-phone", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close the port and every connection."""
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(2.0)

    def _run(self) -> None:
        with self._runner as runner:  # which cancels the connections at its end
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._connected, sock=self._listener, limit=LONGEST_REQUEST)
        await self._over.wait()
        server.close()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Reply to one request, and close the connection whatever came of it."""
        # Refusing the newest would let 32 slow connections keep every phone out.
        if len(self._connections) == MOST_CONNECTIONS:
            oldest = next(iter(self._connections))
            del self._connections[oldest]
            oldest.transport.abort()
        self._connections[writer] = None
        try:
            async with asyncio.timeout(REQUEST_S):
                writer.write(self._reply(await reader.readuntil(b"\r\n\r\n")))
                writer.close()
                await writer.wait_closed()
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, OSError):
            pass  # too slow, too long, or a phone that went away
        finally:
            self._connections.pop(writer, None)
            writer.transport.abort()

    def _reply(self, request: bytes) -> bytes:
        """The whole reply: the page or its numbers, 404 for everything else."""
        status, kind, body = HTTPStatus.BAD_REQUEST, "text/plain", b""
        match request.split(b"\r\n", 1)[0].decode("latin-1").split(" "):
            case ["GET", path, _]:
                found = self._answer(path)
                status = HTTPStatus.OK if found else HTTPStatus.NOT_FOUND
                kind, body = found or (kind, b"not found\n")
            case [_, _, _]:
                status = HTTPStatus.NOT_IMPLEMENTED
        first = f"HTTP/1.1 {status.value} {status.phrase}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n"
        return f"{first}{HEADERS}\r\n".encode("ascii") + body


def local_address() -> str:
    """The address of this computer on the local network, without asking anybody; else loopback.

    A datagram socket that is only connected, never written to, shows which address would be used.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # A private address, so that the route of the local network answers; no packet is sent.
            probe.connect(("10.255.255.255", 9))
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"


def state_json(state: AlignmentState, now_s: float) -> dict[str, Any]:
    """A state as the page's words, and as numbers for programs that read its JSON."""
    fields: dict[str, Any] = {
        "words": state.words,
        "solved": state.solved,
        "age": state.age_words(now_s),
        "old": state.old(now_s) or state.stage == "ended",
    }
    return fields | ({} if state.known_error is None else _error_json(state.known_error, not state.spoilt))


def _error_json(error: PolarError, usable: bool) -> dict[str, Any]:
    """An error, and what to turn, unless it is not to be trusted."""
    sigma = error.with_systematics
    words = {
        knob.value: f"{(way := cure(error, knob)).sign} {way.word} {angle_in_words(error.knob_arcsec(knob))}"
        for knob in Knob
        if usable
    }
    return words | {
        "total": angle_in_words(error.total_arcsec),
        "sigma": f"± {angle_in_words(sigma.sigma_total_arcsec)}",
        "altitude_error_arcsec": error.altitude_arcsec,
        "azimuth_error_arcsec": error.azimuth_arcsec,
        "total_arcsec": error.total_arcsec,
        "sigma_arcsec": list(sigma.sigma_arcsec),
    }
