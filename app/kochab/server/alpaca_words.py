"""What every Alpaca device of ours answers with: error numbers, the envelope, and how parameters are read.

Facts: ASCOM Alpaca API Reference 12.
"""

import json
import math
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from kochab.server.http_server import Response

NOT_IMPLEMENTED, INVALID_VALUE, VALUE_NOT_SET, NOT_CONNECTED = 0x400, 0x401, 0x402, 0x407
INVALID_OPERATION, ACTION_NOT_IMPLEMENTED = 0x40B, 0x40C
Json = dict[str, Any]
METHODS = ("GET", "PUT")
WRONG_METHOD = Response(b"GET or PUT.\n", "text/plain", HTTPStatus.METHOD_NOT_ALLOWED, allow=", ".join(METHODS))
"""To POST, which a web page elsewhere could send unasked."""


class Fault(Exception):  # noqa: N818 (an answer of the protocol)
    """An ASCOM error: its number and its sentence."""

    def __init__(self, number: int, sentence: str) -> None:
        super().__init__(sentence)
        self.number = number


class BadRequest(Exception):  # noqa: N818 (an answer of the protocol)
    """What makes no sense at all, which Alpaca answers with HTTP 400."""


def envelope(given: Mapping[str, str], transaction: int, value: Any, fault: Fault | None = None) -> Response:
    """The answer of a device.

    Parameters
    ----------
    given : Mapping[str, str]
        What came with the request: the client's own number of it is in the answer, too.
    transaction : int
        Our number of it.
    value : Any
        What was read; None for a method, which has none.
    fault : Fault or None
        Why it was refused.
    """
    name = "ClientTransactionID"
    body: Json = {
        name: whole(given, name if name in given else name.lower()),
        "ServerTransactionID": transaction % 2**32,
        "ErrorNumber": 0 if fault is None else fault.number,
        "ErrorMessage": "" if fault is None else str(fault),
    }
    if value is not None:
        body["Value"] = value
    return Response(json.dumps(body).encode())


def whole(given: Mapping[str, str], name: str, absent: int | None = 0) -> int | None:
    """A whole number of zero or more; BadRequest for anything else, and where one is missing that must be given."""
    text = given.get(name)
    if text is None and absent is not None:
        return absent
    if text is None or not text.isdecimal() or int(text[:12]) >= 2**32:
        raise BadRequest(f"{name} is not a whole number.")
    return int(text[:12])


def number(given: Mapping[str, str], name: str) -> float:
    """A finite number; BadRequest for anything else."""
    try:
        value = float(given[name])
    except (KeyError, ValueError):
        raise BadRequest(f"{name} is not a number.") from None
    if not math.isfinite(value):
        raise BadRequest(f"{name} is not a number.")
    return value


def truth(given: Mapping[str, str], name: str) -> bool:
    """True or false; BadRequest for anything else."""
    text = given.get(name, "").lower()
    if text not in ("true", "false"):
        raise BadRequest(f"{name} is neither true nor false.")
    return text == "true"
