"""The protocols of mounts: commands to bytes and replies to values, nothing else.

Every parser takes any bytes at all and either returns a value or raises
:class:`~kochab.gear.mounts.serial_line.ProtocolError`.
"""

import re

from kochab.gear.mounts.serial_line import ProtocolError
from kochab.text.translation import tr


def match(pattern: bytes, reply: bytes, what: str) -> re.Match[bytes]:
    """The match of the whole reply; `ProtocolError` when it is no ``what``."""
    # The whole reply must match: leftovers before or after it belong to another question.
    found = re.fullmatch(pattern, reply)
    if found is None:
        raise ProtocolError("{reply!r} is no {what}.", reply=reply, what=tr(what))
    return found


def require(valid: bool, reply: bytes, what: str) -> None:
    """`ProtocolError` when the values of a reply are out of range."""
    if not valid:
        raise ProtocolError("{reply!r} is no {what}.", reply=reply, what=tr(what))


def parse_accepted(reply: bytes) -> bool:
    """A bare ``1`` (accepted) or ``0`` (refused)."""
    return match(rb"[01]", reply, "0 or 1")[0] == b"1"


def code_table(table: str, base: int = 10) -> dict[int, str]:
    """Code -> name, from ``"1 NexStar GPS, 3 NexStar i-Series"``."""
    return {int(code, base): name for code, name in (row.split(maxsplit=1) for row in table.split(", "))}
