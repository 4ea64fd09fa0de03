"""Where to go: a name the catalogue knows, or coordinates as people type them."""

import re
from datetime import datetime

from app.core.errors import UsageError
from app.core.progress import Progress, Task
from app.ui.angle_input import parse_dec_deg, parse_ra_deg
from app.workflows.goto_target import Target, named_target, target_at

NOTHING = "Say where: a name such as M 42, Vega or HIP 32349, or “5h35m17s -5d23m”."


def parse_target(text: str, time_utc: datetime) -> Target:
    """A target from ``M 42``, ``Vega``, ``83.82 -5.39``, ``5h35m17s, -5d23m28s``.

    A name is looked up in the catalogue, which takes a moment the first time: not for the
    window's thread. UsageError says what is wrong.
    """
    clean = " ".join(text.split())
    if not clean:
        raise UsageError(NOTHING)
    if re.match(r"[+-]?[\d.]+\s*([hd°:,\s]|$)", clean) and not re.match(r"\d+ [A-Za-z]{3}", clean):
        return target_at(*_coordinates(clean))
    return named_target(clean, time_utc)


def _coordinates(text: str) -> tuple[float, float]:
    """Split at the comma or semicolon, before the sign, or in the middle of an even count."""
    for pattern in (r"\s*[,;]\s*(?=[+\-−\d])", r"\s+(?=[+\-−])"):
        parts = re.split(pattern, text)
        if len(parts) == 2:
            return parse_ra_deg(parts[0]), parse_dec_deg(parts[1])
    words = text.split()
    if len(words) % 2 == 0:
        half = len(words) // 2
        return parse_ra_deg(" ".join(words[:half])), parse_dec_deg(" ".join(words[half:]))
    raise UsageError(f"“{text}” is neither a name nor two coordinates. {NOTHING}")


def names_to_offer() -> Task[list[str]]:
    """What the field completes: Messier objects and the stars that bear a name of their own."""
    yield Progress("names")
    from app.sky.catalogue import open_catalogue

    stars = sorted({name for name, _, _ in open_catalogue().names.table.values() if name})
    return [f"M {n}" for n in range(1, 111)] + stars
