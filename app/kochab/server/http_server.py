"""A small HTTP server for this computer, and for the local network when a person allows it.

Requests have one largest size and one deadline between two bytes; there are so many at a time, and so few large ones.
A request for another host's name is refused: a web page elsewhere cannot reach us by a name that it lets point here.
Nothing is served from files by name: what is asked for goes to one function as a path.
"""

import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise
from socket import socket
from typing import Any
from urllib.parse import parse_qs, urlsplit

from kochab.core.errors import PortError
from kochab.core.values import frozen

LOOPBACK = ("127.0.0.1", "localhost")
MOST_BYTES, MOST_FORM_BYTES = 800_000_000, 1_000_000
"""Of a body: with a file (61 megapixels of three 32-bit colours), and without."""
MOST_AT_ONCE, MOST_LARGE, QUIET_S = 32, 2, 30.0
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline';"
    " connect-src 'self'; img-src 'self' blob:; form-action 'none'; frame-ancestors 'none'",
}


@frozen
class Request:
    """What was asked: method, path without its query, the query, and a form's fields; ``file`` is (name, content).

    ``body`` is what was sent, ``authorization`` the header of that name.
    """

    method: str
    path: str
    query: Mapping[str, str] = field(default_factory=dict)
    form: Mapping[str, str] = field(default_factory=dict)
    file: tuple[str, bytes] | None = None
    body: bytes = b""
    authorization: str = ""


@frozen
class Response:
    """What is answered; ``name`` is what a browser saves it as, ``lines`` go out one by one, in place of a body.

    ``allow`` are the methods that the address has, where another one was asked for.
    """

    body: bytes
    kind: str = "application/json"
    status: HTTPStatus = HTTPStatus.OK
    name: str = ""
    lines: Iterator[bytes] | None = None
    allow: str = ""


Answer = Callable[[Request], Response]


class HttpServer:
    """Answers at ``host``, ``port`` in threads of its own until :meth:`stop`; PortError when it cannot listen there."""

    def __init__(self, answer: Answer, host: str = LOOPBACK[0], port: int = 0) -> None:
        try:
            self._server = _Server((host, port), answer)
        except OSError as error:
            raise PortError(
                "Can't listen at {host}:{port}: {why}.", host=host, port=port, why=error.strerror or error
            ) from None
        self.address: tuple[str, int] = self._server.server_address[:2]  # type: ignore[assignment]
        self._thread = threading.Thread(target=self._server.serve_forever, name="kochab-http", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close the port."""
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = MOST_AT_ONCE
    # On Windows it would let two programs listen at one port, each with half of what comes.
    allow_reuse_address = sys.platform != "win32"

    def __init__(self, address: tuple[str, int], answer: Answer) -> None:
        super().__init__(address, _Handler)
        self.answer = answer
        host, port = self.server_address[:2]
        names = {str(host), *(LOOPBACK if host == LOOPBACK[0] else ())}
        self.hosts = {*names, *(f"{name}:{port}" for name in names)}
        self.large = threading.BoundedSemaphore(MOST_LARGE)
        self._free = threading.BoundedSemaphore(MOST_AT_ONCE)

    def process_request(self, request: Any, client_address: Any) -> None:
        """One thread a connection, as long as there are not too many."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: "socket | tuple[bytes, socket]", client_address: Any) -> None:
        """Ignore a connection that broke."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = QUIET_S
    server_version, sys_version, protocol_version = "Kochab", "", "HTTP/1.1"

    def do_GET(self) -> None:
        self._handle(b"")

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        size = int(length) if length.isdecimal() and len(length) < 13 else -1
        if size < 0:
            return self._send(_status_only(HTTPStatus.LENGTH_REQUIRED))
        if size > MOST_BYTES:
            return self._send(_status_only(HTTPStatus.REQUEST_ENTITY_TOO_LARGE))
        if size <= MOST_FORM_BYTES:
            return self._handle(self.rfile.read(size))
        with self.server.large:
            return self._handle(self.rfile.read(size))

    def do_PUT(self) -> None:
        self.do_POST()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer what http.server itself refuses: another method, a line that is too long."""
        if code == HTTPStatus.NOT_IMPLEMENTED:
            status = HTTPStatus.METHOD_NOT_ALLOWED
            return self._send(Response(f"{status.phrase}\n".encode(), "text/plain", status, allow="GET, POST"))
        return self._send(_status_only(HTTPStatus(code)))

    def _handle(self, body: bytes) -> None:
        if self.headers.get("Host", "").lower() not in self.server.hosts:
            return self._send(_status_only(HTTPStatus.MISDIRECTED_REQUEST))
        try:
            split = urlsplit(self.path)
            query = {name: values[0] for name, values in parse_qs(split.query, max_num_fields=20).items()}
        except ValueError:
            return self._send(_status_only(HTTPStatus.BAD_REQUEST))
        form, file = parse_form(self.headers.get("Content-Type", ""), body)
        try:
            response = self.server.answer(
                Request(self.command, split.path, query, form, file, body, self.headers.get("Authorization", ""))
            )
        except Exception:  # a fault of ours is not a traceback of the caller's
            import logging

            logging.getLogger(__name__).exception("request failed")
            response = _status_only(HTTPStatus.INTERNAL_SERVER_ERROR)
        return self._send(response)

    def _send(self, response: Response) -> None:
        self.close_connection = True
        self.send_response(response.status)
        allowed = {"Allow": response.allow} if response.allow else {}
        named = {"Content-Disposition": f'attachment; filename="{response.name}"'} if response.name else {}
        own = {"Content-Type": response.kind, "Connection": "close"}
        if response.lines is None:
            own["Content-Length"] = str(len(response.body))
        for name, value in (HEADERS | own | named | allowed).items():
            self.send_header(name, value)
        self.end_headers()
        for part in (response.body,) if response.lines is None else response.lines:
            self.wfile.write(part)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not printed."""


def _status_only(status: HTTPStatus) -> Response:
    return Response(f"{status.phrase}\n".encode(), "text/plain", status)


def parse_form(kind: str, body: bytes) -> tuple[dict[str, str], tuple[str, bytes] | None]:
    """The fields of a form, URL-encoded or in parts, and the file in it as (name, content); both may be missing."""
    if kind.startswith("application/x-www-form-urlencoded"):
        text = body.decode("utf-8", "replace")
        try:
            return {name: values[0] for name, values in parse_qs(text, max_num_fields=50).items()}, None
        except ValueError:
            return {}, None
    found = re.search(r'boundary="?([^";,]{1,70})"?', kind)
    if not kind.startswith("multipart/form-data") or not found:
        return {}, None
    form: dict[str, str] = {}
    file: tuple[str, bytes] | None = None
    border, at = b"--" + found[1].encode("latin-1", "replace"), 0
    starts: list[int] = []
    while (at := body.find(border, at)) >= 0 and len(starts) < 100:
        starts.append(at)
        at += len(border)
    for start, end in pairwise(starts):
        head_end = body.find(b"\r\n\r\n", start, end)
        if head_end < 0 or head_end - start > 10_000:
            continue
        head = body[start:head_end].decode("utf-8", "replace")
        content = body[head_end + 4 : end - 2]  # the line's end belongs to the border
        name = re.search(r'\bname="([^"\r\n]*)"', head)
        of_file = re.search(r'\bfilename="([^"\r\n]*)"', head)
        if of_file:
            file = (of_file[1], content)
        elif name:
            form[name[1]] = content[:MOST_FORM_BYTES].decode("utf-8", "replace")
    return form, file
