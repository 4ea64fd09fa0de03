"""The first bytes of ``kochab mount stop``: on the line before anything heavy is imported, and before it is parsed.

The command itself follows: it sends Stop again, and sees whether the mount stands.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from kochab.core.errors import KochabError, UsageError
from kochab.folders import config_folder, file_stem

STOPS = {
    "lx200": (9600, b"#:Q#"),
    "onstep": (9600, b"#:Q#"),
    **dict.fromkeys(("10micron", "am5", "teenastro", "astrophysics", "gemini"), (9600, b"#:Q#")),
    **dict.fromkeys(("nyx", "rainbow"), (115200, b"#:Q#")),
    **dict.fromkeys(("nexstar", "starsense"), (9600, b"MP\2\x10$\0\0\0\0P\2\x11$\0\0\0\0")),
    "synscan": (9600, b"MMP\2\x10$\0\0\0\0P\2\x11$\0\0\0\0"),
    "ioptron": (115200, b"#:Q#:qR#:qD#"),
    "skywatcher": (9600, b":L1\r:L2\r"),
    "celestronaux": (9600, b";\x04 \x10$\0\xa8;\x04 \x11$\0\xa7"),
}
"""Driver -> its usual baud rate and the bytes of Stop, as its class has them, which would take too long to import."""
SERVER_PORTS = {"indi": 7624, "alpaca": 11111}
SERVER_STOPS = {
    "indi": '<getProperties version="1.7" device="DEVICE"/><newSwitchVector device="DEVICE"'
    ' name="TELESCOPE_ABORT_MOTION"><oneSwitch name="ABORT">On</oneSwitch></newSwitchVector>'
    # by ABORT every driver forgets its moves, but INDI's for iOptron ends slews alone
    + "".join(
        f'<newSwitchVector device="DEVICE" name="TELESCOPE_MOTION_{axis}">'
        f'<oneSwitch name="MOTION_{a}">Off</oneSwitch><oneSwitch name="MOTION_{b}">Off</oneSwitch></newSwitchVector>'
        for axis, a, b in (("NS", "NORTH", "SOUTH"), ("WE", "WEST", "EAST"))
    ),
    "alpaca": "PUT /api/v1/telescope/DEVICE/abortslew HTTP/1.1\r\nHost: kochab\r\nConnection: close\r\nContent-Type:"
    " application/x-www-form-urlencoded\r\nContent-Length: 35\r\n\r\nClientID=6521&ClientTransactionID=1",
}
"""Driver of a server -> the bytes of Stop, in which DEVICE stands for the name or the number of the mount."""
NETWORK_S, TIMES = 0.5, 3
HARMLESS = (
    (9600, STOPS["synscan"][1] + STOPS["celestronaux"][1] + STOPS["skywatcher"][1] + STOPS["lx200"][1]),
    (115200, STOPS["skywatcher"][1] + STOPS["lx200"][1]),
)
"""Baud rate -> the Stops that may go to a mount that nobody knows: none of them begins a motion on another make.

A NexStar takes single letters for commands, and ``R`` in an iOptron's ``:qR#`` for a goto: of that make only the slews
are ended, by ``:Q#``, until it is known. A NexStar's Stop goes first, as no command's arguments are awaited then.
"""


def send_first_stop(arguments: Sequence[str]) -> None:
    """Send Stop to the port and the driver that are named, or that the profile names, or that were used last.

    A port whose mount nobody names gets all the Stops that harm no other make; without any port nothing is done.
    """
    given = dict.fromkeys(("port", "driver", "baud", "profile"), "")
    for word, after in zip(arguments, [*arguments[1:], ""], strict=True):
        name, equals, value = word.removeprefix("--").partition("=")
        if word.startswith("--") and name in given:
            given[name] = value if equals else after
    with suppress(OSError, ValueError, TypeError, AttributeError, UsageError):  # the command says what is wrong
        if given["profile"]:
            from kochab.parsing.text_input import read_json

            kept = read_json(profile_path(given["profile"]))
            given |= {name: value or str(kept.get(name) or "") for name, value in given.items()}
        if not given["driver"] or not given["port"]:
            last = last_used()
            if given["port"] in ("", last["port"]) and given["driver"] in ("", last["driver"]):
                given |= {name: given[name] or value for name, value in last.items()}
        if given["port"] and not given["driver"] and "udp://" not in given["port"]:
            _send_all(given["port"], given["baud"])
            return
        baud, stop = STOPS.get(given["driver"] or "skywatcher", (0, b""))  # only that make has udp://
        if given["driver"] in SERVER_PORTS or given["port"].startswith("udp://"):
            _send_over_network(given["driver"], given["port"], stop)
        elif stop and given["port"]:
            _send(given["port"], int(given["baud"] or baud), stop)


def _send(port: str, baud: int, stop: bytes) -> None:
    """Over a serial line or TCP."""
    import serial

    # pyserial knows the address as socket://.
    with serial.serial_for_url(port.replace("tcp://", "socket://", 1), baudrate=baud, write_timeout=1.0) as line:
        line.write(stop)


def _send_all(port: str, baud: str) -> None:
    """Every harmless Stop at its baud rate, or at the one that is given; TCP has none, and a NexStar may be there."""
    rates = HARMLESS[:1] if "://" in port else HARMLESS
    for usual, stop in rates:
        if not baud or int(baud) == usual:
            _send(port, usual, stop)


def _send_over_network(driver: str, address: str, stop: bytes) -> None:
    """Send Stop to a motor board by UDP, or to a server; an INDI device has to be named in the address."""
    import socket
    from urllib.parse import urlsplit

    server, _, device = address.rpartition("://")[2].partition("/")
    where = urlsplit(f"//{server}")
    to = where.hostname or "localhost", where.port or SERVER_PORTS.get(driver, 0)
    if driver not in SERVER_PORTS:
        kind = socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0][0]
        with socket.socket(kind, socket.SOCK_DGRAM) as line:
            for command in TIMES * stop.splitlines(keepends=True):  # each in a datagram of its own, and some are lost
                line.sendto(command, to)
        return
    # A name with such letters would need escaping in XML; the command itself sends that Stop.
    if driver == "indi" and (not device or re.search("[<>&\"']", device)):
        return
    name = device if driver == "indi" else device or "0"
    with socket.create_connection(to, NETWORK_S) as connection:
        connection.sendall(SERVER_STOPS[driver].replace("DEVICE", name).encode())
        while connection.recv(4096) and driver == "alpaca":  # by an answer the server has read it
            pass


# -- The mount that was used last: its port, its driver and its baud rate ------------------------


def last_used_path() -> Path:
    """The file that names it."""
    return config_folder() / "mounts" / "last.json"


def last_used() -> dict[str, str]:
    """Its port, driver and baud rate, each empty where it is not known."""
    from kochab.parsing.text_input import read_json

    kept = None
    with suppress(OSError, ValueError, KochabError):
        kept = read_json(last_used_path())
    return {name: str((kept if isinstance(kept, dict) else {}).get(name) or "") for name in ("port", "driver", "baud")}


# -- Where a profile lies, for those who must not import all that it knows ----------------------


def profile_folder() -> Path:
    """Where profiles lie: below ``KOCHAB_CONFIG``, or in the user's own configuration."""
    return config_folder() / "equipment"


def profile_path(name: str) -> Path:
    """The file of the profile of that name; UsageError when the name is empty."""
    if not name.strip():
        raise UsageError("A profile needs a name.")
    return profile_folder() / f"{'-'.join(file_stem(name, 'profile'))}.json"
