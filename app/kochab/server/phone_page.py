"""The alignment on a phone: one read-only page over the local network, off until switched on.

GET only, two addresses under a random token, no files, no query, short timeouts and few
connections. Without the token every request gets 404. Nothing is sent anywhere by itself.
"""

import json
import secrets
import socket
import threading
from contextlib import suppress
from hmac import compare_digest
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from kochab.core.errors import PortError
from kochab.polar.error import PolarError, angle_in_words

PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width,initial-scale=1">
<title>Kochab: polar alignment</title>
<style>
html,body{margin:0;background:#000;color:#f00;font-family:system-ui,sans-serif;height:100%}
main{display:flex;flex-direction:column;min-height:100%;justify-content:space-evenly;
text-align:center;padding:0 4vw}
#total{font-size:26vw;line-height:1;font-weight:700;font-variant-numeric:tabular-nums}
#sigma{font-size:7vw}.axis{font-size:9vw;line-height:1.25;font-variant-numeric:tabular-nums}
#words{font-size:6.5vw;line-height:1.3}#stale{font-size:5vw;min-height:1.4em}
.old #total{opacity:.4}
@media(orientation:landscape){#total{font-size:24vh}.axis{font-size:11vh}#words,#sigma{font-size:8vh}}
</style></head><body><main aria-live="polite">
<div><div id="total">-</div><div id="sigma"></div></div>
<div class="axis" id="alt"></div><div class="axis" id="az"></div>
<div id="words"></div><div id="stale"></div></main>
<script>
'use strict';
const put=(id,text)=>{document.getElementById(id).textContent=text||''};
let received=0;
async function ask(){
 try{
  const answer=await fetch('now.json',{cache:'no-store'});
  if(!answer.ok)throw 0;
  const now=await answer.json();
  put('total',now.total);put('sigma',now.sigma);put('alt',now.altitude);put('az',now.azimuth);
  put('words',now.words);
  put('stale',now.solved===false?'No solution for the newest frame yet.':'');
  document.body.className=now.solved===false?'old':'';received=Date.now();
 }catch(e){
  if(Date.now()-received>5000){put('stale','No connection to Kochab.');
  document.body.className='old'}
 }
 setTimeout(ask,500);
}
ask();
</script></body></html>
"""

TOKEN_BYTES = 16
CONNECTION_S = 10.0  # of silence, then the connection is closed
LONGEST_S = 15.0  # for a whole request: one sent letter by letter must not hold its thread
MOST_CONNECTIONS = 16
LONGEST_PATH = 200


class PhonePage:
    """Serves the newest error; :meth:`show` may be called from any thread, at any rate."""

    def __init__(self, token: str | None = None) -> None:
        self._token = token or secrets.token_urlsafe(TOKEN_BYTES)
        self._numbers: dict[str, Any] = {}
        self._server: _Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def running(self) -> bool:
        """Whether the page is being served."""
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
            The address or port cannot be used.

        """
        if self._server is not None:
            return self.url
        address = host or local_address()
        try:
            self._server = _Server((address, port), self)
        except OSError as error:
            raise PortError(f"Can't serve the phone page at {address}: {error.strerror or error}.") from None
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, name="kochab-phone", daemon=True
        )
        self._thread.start()
        return self.url

    def stop(self) -> None:
        """Switch off; the port is closed at once."""
        server, self._server = self._server, None
        if server is not None:
            server.shutdown()
            server.server_close()
        if self._thread is not None:
            self._thread.join(2.0)
            self._thread = None

    def show(self, words: str, error: PolarError | None = None, solved: bool = True) -> None:
        """Replace what phones see: what to do, and the error once there is one."""
        self._numbers = {"words": words, "solved": solved} | ({} if error is None else _error_json(error))

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
        """Serve in a thread, or close the connection when there are too many already."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Free the place however the request ends, and end it after :data:`LONGEST_S`."""
        limit = threading.Timer(LONGEST_S, _hang_up, (request,))
        limit.daemon = True
        limit.start()
        try:
            super().process_request_thread(request, client_address)
        finally:
            limit.cancel()
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a phone that went away, and malformed requests."""


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
            "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'",
        )
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Keep no access log."""


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


def _error_json(error: PolarError) -> dict[str, Any]:
    """The error as the page's words, and as numbers for programs that read its JSON.

    Arrows hold from every side of the mount: up and down for the axis, and the sense of rotation,
    seen from above, for the azimuth.
    """
    altitude, azimuth = error.altitude_arcsec, error.azimuth_arcsec
    sigma = error.with_flexure
    return {
        "total": angle_in_words(error.total_arcsec),
        "sigma": f"± {angle_in_words(sigma.sigma_total_arcsec)}",
        "altitude": f"{'▼ lower' if altitude > 0 else '▲ raise'} {angle_in_words(altitude)}",
        "azimuth": f"{'↺ anticlockwise' if azimuth > 0 else '↻ clockwise'} {angle_in_words(azimuth)}",
        "altitude_error_arcsec": altitude,
        "azimuth_error_arcsec": azimuth,
        "total_arcsec": error.total_arcsec,
        "sigma_arcsec": list(sigma.sigma_arcsec),
    }
