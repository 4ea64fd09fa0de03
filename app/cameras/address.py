"""What a person types to name a camera on another computer: ``host:port/camera``."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.core.errors import PortError


@dataclass(frozen=True, slots=True)
class NetAddress:
    """A server and what is wanted of it; ``rest`` is empty when nothing was named."""

    host: str
    port: int
    rest: str = ""

    @property
    def server(self) -> str:
        """Host and port as they are typed."""
        return f"{self.host}:{self.port}"


def net_address(text: str, default_port: int) -> NetAddress:
    """``text`` taken apart; nothing means this computer.

    An IPv6 host stands in brackets: ``[fe80::1]:7624/Camera``.

    Raises
    ------
    PortError
        The port is not a number from 1 to 65535.

    """
    server, _, rest = text.strip().removeprefix("http://").partition("/")
    host, port = server, ""
    if server.startswith("["):
        host, _, port = server.partition("]")
        host, port = host + "]", port.removeprefix(":")
    elif ":" in server:
        host, _, port = server.partition(":")
    number = int(port) if port.isascii() and port.isdigit() else (0 if port else default_port)
    if not 1 <= number <= 65535:
        raise PortError(f"'{port}' is not a port; write the address as host:{default_port}.")
    return NetAddress(host or "localhost", number, rest.strip("/"))


def chosen(cameras: Sequence[tuple[str, str]], where: NetAddress, kind: str) -> str:
    """Which of a server's ``cameras``, each its address there and its name, ``where.rest`` names.

    The only one need not be named. ``kind`` says of what protocol the server is.

    Raises
    ------
    PortError
        There is no such camera, none, or one has to be named: with those that there are.

    """
    for address, name in cameras:
        if where.rest in (address, name):
            return address
    there = ", ".join(a if a == name else f"{a} ({name})" for a, name in cameras)
    if where.rest:
        others = f"; there is {there}" if cameras else ""
        raise PortError(f"{where.server} has no camera {where.rest}{others}.")
    if not cameras:
        raise PortError(f"The {kind} server {where.server} has no camera.")
    if len(cameras) > 1:
        example = f"{where.server}/{cameras[0][0]}"
        raise PortError(f"{where.server} has several cameras: {there}. Write {example}.")
    return cameras[0][0]
