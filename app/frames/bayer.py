"""The colour pattern over a sensor, from what a header says of it."""

from collections.abc import Mapping
from typing import Any

_PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")


def bayer_pattern(values: Mapping[str, Any], height: int) -> str | None:
    """The 2 x 2 pattern read from the array's pixel (0, 0), or None for a grey frame.

    ``XBAYROFF`` and ``YBAYROFF`` shift the named pattern; with ``ROWORDER = BOTTOM-UP`` it is
    named from the array's last row, which such programs show on top.
    """
    name = ""
    for key in ("BAYERPAT", "COLORTYP", "CFA_PAT", "FILTER"):
        name = str(values.get(key, "")).strip().upper()
        if name in _PATTERNS:
            break
    else:
        return None
    x, y = _offset(values.get("XBAYROFF")), _offset(values.get("YBAYROFF"))
    if str(values.get("ROWORDER", "")).strip().upper() == "BOTTOM-UP":
        y += height - 1
    return shifted(name, x, y)


def shifted(pattern: str, x: int, y: int) -> str:
    """The pattern seen from ``x`` columns and ``y`` rows further on."""
    at = [[0, 1], [2, 3]]
    return "".join(pattern[at[(r + y) % 2][(c + x) % 2]] for r in (0, 1) for c in (0, 1))


def _offset(value: Any) -> int:
    try:
        return int(float(value))
    except (TypeError, ValueError, OverflowError):
        return 0
