"""The first bytes of ``kochab mount stop``: on the line before anything heavy is imported, and before it is parsed.

The command itself follows: it sends Stop again, and sees whether the mount stands.
"""

import hashlib
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from kochab.core import config_folder
from kochab.core.errors import UsageError

STOPS = {
    "lx200": (9600, b"#:Q#"),
    "onstep": (9600, b"#:Q#"),
    **dict.fromkeys(("10micron", "am5", "teenastro", "astrophysics", "gemini"), (9600, b"#:Q#")),
    **dict.fromkeys(("nyx", "rainbow"), (115200, b"#:Q#")),
    "nexstar": (9600, b"M"),
    "starsense": (9600, b"M"),
    "synscan": (9600, b"MM"),
    "ioptron": (115200, b"#:Q#"),
    "skywatcher": (9600, b":L1\r:L2\r"),
}
"""Driver -> its usual baud rate and the bytes of Stop, as its class has them, which would take too long to import."""


def send_first_stop(arguments: Sequence[str]) -> None:
    """Send Stop to the port and the driver that are named, or that the profile names; otherwise nothing is done."""
    given = dict.fromkeys(("port", "driver", "baud", "profile"), "")
    for word, after in zip(arguments, [*arguments[1:], ""], strict=True):
        name, equals, value = word.removeprefix("--").partition("=")
        if word.startswith("--") and name in given:
            given[name] = value if equals else after
    with suppress(OSError, ValueError, TypeError, AttributeError, UsageError):  # the command says what is wrong
        if given["profile"]:
            import json

            kept = json.loads(profile_path(given["profile"]).read_text("utf-8"))
            given |= {name: value or str(kept.get(name) or "") for name, value in given.items()}
        baud, stop = STOPS.get(given["driver"], (0, b""))
        if stop and given["port"] and not given["port"].startswith("udp://"):
            import serial

            port = given["port"].replace("tcp://", "socket://", 1)
            with serial.serial_for_url(port, baudrate=int(given["baud"] or baud), write_timeout=1.0) as line:
                line.write(stop)


# -- Where a profile lies, for those who must not import all that it knows ----------------------


def profile_folder() -> Path:
    """Where profiles lie: below ``KOCHAB_CONFIG``, or in the user's own configuration."""
    return config_folder() / "equipment"


def profile_path(name: str) -> Path:
    """The file of the profile of that name; UsageError when the name is empty."""
    if not name.strip():
        raise UsageError("A profile needs a name.")
    plain = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower()[:40] or "profile"
    return profile_folder() / f"{plain}-{hashlib.sha256(name.encode('utf-8')).hexdigest()[:8]}.json"
