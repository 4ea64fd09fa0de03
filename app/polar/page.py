"""The alignment on a phone: one read-only page over the local network, off until switched on.

The standard library's HTTP server with everything cut away that is not needed: GET only, three
addresses under a random token, no files, no query, short timeouts and few connections. Whoever
does not know the token gets 404 for whatever is asked. Nothing is sent anywhere by itself.
"""

import json
import secrets
import socket
import threading
from contextlib import suppress
from hmac import compare_digest
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from typing import Any

from app.core.errors import PortError
from app.polar.page_html import PAGE

TOKEN_BYTES = 16
CONNECTION_S = 10.0  # of silence
LONGEST_S = 15.0  # in all
MOST_CONNECTIONS = 16
LONGEST_PATH = 200


class PhonePage:
    """Serves the newest numbers; :meth:`show` may be called from any thread, at any rate."""

    def __init__(self, token: str | None = None) -> None:
        self._token = token or secrets.token_urlsafe(TOKEN_BYTES)
        self._numbers: dict[str, Any] = {"stage": "waiting"}
        self._server: _Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def running(self) -> bool:
        """Whether it is switched on."""
        return self._server is not None

    @property
    def url(self) -> str:
        """What a phone opens; empty while switched off."""
        if self._server is None:
            return ""
        host, port = self._server.server_address[:2]
        return f"http://{host!s}:{port}/{self._token}/"

    def start(self, host: str | None = None, port: int = 0) -> str:
        """Switch on, at the address this computer has on the local network, and return the URL.

        Raises
        ------
        PortError
            The address or port cannot be had.

        """
        if self._server is not None:
            return self.url
        address = host or local_address()
        try:
            self._server = _Server((address, port), self)
        except OSError as error:
            raise PortError(
                f"The page for the phone cannot be served at {address}: {error.strerror or error}."
            ) from None
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.1},
            name="kochab-phone", daemon=True,
        )  # fmt: skip
        self._thread.start()
        return self.url

    def stop(self) -> None:
        """Switch off; the address is gone at once."""
        server, self._server = self._server, None
        if server is not None:
            server.shutdown()
            server.server_close()
        if self._thread is not None:
            self._thread.join(2.0)
            self._thread = None

    def show(self, numbers: dict[str, Any]) -> None:
        """Replace what phones see; plain numbers and words, as :func:`page_numbers` makes them."""
        self._numbers = dict(numbers)

    def qr_svg(self, scale: int = 6) -> str:
        """The URL as a QR code, an SVG picture; empty while switched off."""
        if not self.url:
            return ""
        import segno

        out = BytesIO()
        segno.make(self.url, error="m", micro=False).save(
            out, kind="svg", scale=scale, border=4, dark="#000", light="#fff", xmldecl=False
        )
        return out.getvalue().decode("utf-8")

    def answer(self, path: str) -> tuple[str, bytes] | None:
        """Content type and body for a path; None for whatever is not there."""
        parts = path.split("/")
        if len(path) > LONGEST_PATH or len(parts) != 3 or parts[0]:
            return None
        if not compare_digest(parts[1].encode(), self._token.encode()):
            return None
        if parts[2] == "":
            return "text/html; charset=utf-8", PAGE.encode("utf-8")
        if parts[2] == "now.json":
            return "application/json", json.dumps(self._numbers).encode("utf-8")
        return None


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = 8

    def __init__(self, address: tuple[str, int], page: PhonePage) -> None:
        self.page = page
        self._free = threading.BoundedSemaphore(MOST_CONNECTIONS)
        super().__init__(address, _Request)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve in a thread, or hang up when there are too many already."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Give the place back, however it ends; who asks letter by letter is hung up on."""
        limit = threading.Timer(LONGEST_S, _hang_up, (request,))
        limit.daemon = True
        limit.start()
        try:
            super().process_request_thread(request, client_address)
        finally:
            limit.cancel()
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A phone that went away, or nonsense: nobody needs to know."""


class _Request(BaseHTTPRequestHandler):
    server: _Server
    timeout = CONNECTION_S
    server_version = "Kochab"
    sys_version = ""

    def do_GET(self) -> None:
        """The page or its numbers; 404 for everything else."""
        found = self.server.page.answer(self.path)
        if found is None:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", b"not found\n")
        else:
            self._send(HTTPStatus.OK, *found)

    def _send(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header(
            "Content-Security-Policy",
            "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline';"
            " connect-src 'self'",
        )
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is written about who asked."""


def _hang_up(request: socket.socket) -> None:
    with suppress(OSError):
        request.shutdown(socket.SHUT_RDWR)


def local_address() -> str:
    """The address of this computer on the local network, without asking anybody; else loopback.

    A datagram socket that is only connected, never written to, shows which address would be used.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("10.255.255.255", 9))
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"
