"""The address of a device behind a server, and what is said when nobody answers there sensibly."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from socket import gaierror

from kochab.core.errors import NoAnswerError, PortError, printable
from kochab.core.values import frozen
from kochab.text.angle_text import short_name
from kochab.text.translation import tr, tr_noop

# -- What a person types to name a device on another computer: ``host:port/device`` ------------


@frozen
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

    Raises `PortError` when the port is not a number from 1 to 65535.
    """
    server, _, rest = text.strip().removeprefix("http://").partition("/")
    host, port = server, ""
    if server.startswith("["):
        host, _, port = server.partition("]")
        host, port = host + "]", port.removeprefix(":")  # the brackets tell the colons of IPv6 from that of the port
    elif ":" in server:
        host, _, port = server.partition(":")
    number = int(port) if port.isascii() and port.isdigit() else (0 if port else default_port)
    if not 1 <= number <= 65535:
        raise PortError(
            "'{port}' is not a port; write the address as host:{default}.", port=short_name(port), default=default_port
        )
    return NetAddress(host or "localhost", number, rest.strip("/"))


def unreachable(where: NetAddress, kind: str, error: Exception, program: str = "it") -> PortError:
    """Why nobody at an address could be asked.

    Parameters
    ----------
    where : NetAddress
        The address.
    kind : str
        The protocol, for the sentence.
    error : Exception
        What was raised.
    program : str
        What is to be started there.
    """
    if isinstance(error, ConnectionRefusedError):
        return PortError(
            "No {kind} server at {server}. Start {program} there.", kind=kind, server=where.server, program=program
        )
    if isinstance(error, gaierror):
        return PortError("No computer named {host} on this network.", host=where.host)
    return PortError("{server} does not answer. Check its power and network.", server=where.server)


MOST_NAMED = 10  # devices in one sentence, of a server that may have thousands


def chosen(devices: Sequence[tuple[str, str]], where: NetAddress, kind: str, what: str = "camera") -> str:
    """Which of a server's devices an address names; the only one need not be named.

    Raises `PortError` when there is no such device, none, or one has to be named: with those that there are.

    Parameters
    ----------
    devices : Sequence[tuple[str, str]]
        Each its address on the server and its name.
    where : NetAddress
        ``rest`` names the device.
    kind : str
        Of what protocol the server is.
    what : str
        What the devices are.
    """
    for address, name in devices:
        if where.rest in (address, name):
            return address
    there = ", ".join(a if a == name else f"{a} ({name})" for a, name in devices[:MOST_NAMED])
    if len(devices) > MOST_NAMED:
        there += ", …"
    if where.rest:
        text = tr_noop("{server} has no {what} {rest}; there is {there}.")
        if not devices:
            text = tr_noop("{server} has no {what} {rest}.")
        raise PortError(text, server=where.server, what=tr(what), rest=where.rest, there=there)
    if not devices:
        raise PortError("The {kind} server {server} has no {what}.", kind=kind, server=where.server, what=tr(what))
    if len(devices) > 1:
        raise PortError(
            "{server} has more than one {what}: {there}. Write {server}/{one}.",
            server=where.server,
            what=tr(what),
            there=there,
            one=devices[0][0],
        )
    return devices[0][0]


# -- Values of a server that are not what they should be --------------------------------

WORDS, NAME = 200, 64  # the longest sentence and name of a server that are shown


def server_text(text: str, most: int = NAME) -> str:
    """What a server calls something, as it may be printed: with escapes for what is not seen, and cut."""
    return short_name(printable(short_name(text, most)), most)


@contextmanager
def making_sense() -> Iterator[None]:
    """Turn what comes of values of the wrong kind into one sentence: None, "x", 1e999, {}."""
    try:
        yield
    except (ValueError, TypeError, AttributeError, ArithmeticError, LookupError) as error:
        raise NoAnswerError("The server reports invalid values.") from error
