"""A network camera: JPEG pictures, one after the other, over HTTP on loopback."""

import io
import threading
import time
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
from PIL import Image


class NetworkCamera:
    """Streams numbered pictures every ``every_s`` until it is unplugged, hangs, or is stopped."""

    def __init__(self, every_s=0.03, colour=False):
        self.every_s, self.colour = every_s, colour
        self.unplugged = threading.Event()
        self.silent = threading.Event()
        self.sent = 0
        handler = type("Handler", (_Handler,), {"camera": self})
        self._server = _Quiet(("127.0.0.1", 0), handler)
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/video"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()

    def jpeg(self, number):
        grey = np.full((120, 160), number % 200 + 20, np.uint8)
        rgb = np.stack([grey, grey // 2, grey // 4], axis=-1)
        out = io.BytesIO()
        Image.fromarray(rgb if self.colour else grey).save(out, "JPEG", quality=95)
        return out.getvalue()

    def stop(self):
        self.unplugged.set()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


class _Quiet(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request, client_address):
        """Lines that break are what is tested."""


class _Handler(BaseHTTPRequestHandler):
    def log_message(self, *args):
        pass

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        camera = self.camera
        with suppress(OSError):
            while not camera.unplugged.is_set():
                if not camera.silent.is_set():
                    camera.sent += 1
                    data = camera.jpeg(camera.sent)
                    head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                    self.wfile.write(head.encode() + data + b"\r\n")
                time.sleep(camera.every_s)
