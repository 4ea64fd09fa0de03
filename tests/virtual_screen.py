"""A virtual X screen for tests that start programs of their own."""

import os
import shutil
import subprocess
from contextlib import contextmanager

import pytest


@contextmanager
def virtual_screen():
    """The display name of a virtual screen of 1600 x 1000 pixels; skips the test where none can be started."""
    if shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed, so there is no virtual screen to draw on")
    reading, writing = os.pipe()
    # A number of its own: a server that ends takes away the socket of one that begins with the same number.
    display = f":{1000 + os.getpid() % 50_000}"
    # And no reset: without it the server begins anew when its last client has left, and one that comes then is refused.
    server = subprocess.Popen(
        ["Xvfb", display, "-displayfd", str(writing), "-screen", "0", "1600x1000x24", "-nolisten", "tcp", "-noreset"],
        pass_fds=[writing],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    with os.fdopen(reading) as ready:
        started = ready.readline().strip()
    if not started:
        server.wait(10)
        pytest.skip("Xvfb did not start")
    try:
        yield display
    finally:
        server.terminate()
        server.wait(10)
