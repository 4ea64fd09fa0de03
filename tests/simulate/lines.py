"""A simulated mount served on a line for as long as a block lasts."""

from collections.abc import Iterator
from contextlib import contextmanager

from kochab.simulate.serial_line import Faults, own_line, pty_line, socket_line


@contextmanager
def serve_pty(responder, faults: Faults | None = None) -> Iterator[str]:
    """The path of a pseudo-terminal on which ``responder`` answers."""
    line = pty_line(responder, faults)
    try:
        yield line.port
    finally:
        line.stop()


@contextmanager
def serve(responder, faults: Faults | None = None) -> Iterator[str]:
    """The port on which ``responder`` answers, of the kind that the system has."""
    line = own_line(responder, faults)
    try:
        yield line.port
    finally:
        line.stop()


@contextmanager
def serve_socket(responder, faults: Faults | None = None) -> Iterator[str]:
    """``socket://127.0.0.1:PORT`` on which ``responder`` answers."""
    line = socket_line(responder, faults)
    try:
        yield line.port
    finally:
        line.stop()
