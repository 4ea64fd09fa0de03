"""A telescope offered at ports of this computer, and programs that connect."""

import contextlib
import socket
import time
from concurrent.futures import Future
from datetime import UTC, datetime

import pytest

from kochab.core.frame import Site
from kochab.server.telescope.offer import Offer
from kochab.workflows.telescope.offered import OfferedTelescope

NIGHT = datetime(2026, 11, 26, 22, 0, tzinfo=UTC)


class Program:
    """A planetarium's end of a line."""

    def __init__(self, port):
        self.line = socket.create_connection(("127.0.0.1", port), timeout=60)

    def say(self, text):
        self.line.sendall(text if isinstance(text, bytes) else text.encode())

    def hear(self, count=None):
        """So many bytes, or up to ``#``."""
        heard = b""
        while not (len(heard) == count if count else heard.endswith(b"#")):
            try:
                data = self.line.recv(1)
            except ConnectionResetError:  # closed while some of what we said was not read yet
                return heard
            if not data:
                return heard
            heard += data
        return heard

    def ask(self, text, count=None):
        self.say(text)
        return self.hear(count)


class Pushed:
    """A telescope whose person is quick: it stands at the target at once."""

    busy = False

    def __init__(self):
        self.orders = []

    def order(self, name, make, refuse):
        self.orders.append(name)
        verdict: Future = make.args[-1]
        verdict.set_result("")

    def stop(self):
        self.orders.append("stop")


def wait_for(true, patience_s=20.0):
    """Until it is so; what it came to at last."""
    until = time.monotonic() + patience_s
    while not true() and time.monotonic() < until:
        time.sleep(0.01)
    return true()


@pytest.fixture
def told():
    return []


@pytest.fixture
def telescope(told):
    return OfferedTelescope(told.append, now=lambda: NIGHT)


@pytest.fixture
def mount():
    return Pushed()


@pytest.fixture
def steered(mount, told):
    """A telescope with a site and such a mount, which programs may move."""
    return OfferedTelescope(told.append, mount, True, lambda: NIGHT, Site(48.14, 11.58, 520.0))


@pytest.fixture
def offer(telescope):
    offered = Offer(telescope, {"lx200": 0, "stellarium": 0})
    yield offered
    offered.stop()


@pytest.fixture
def program(offer):
    """Connects a program to a protocol's port."""
    with contextlib.ExitStack() as lines:

        def connect(protocol):
            started = Program(offer.ports[protocol])
            lines.enter_context(started.line)
            return started

        yield connect
