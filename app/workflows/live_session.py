"""What a recorded session's folder holds, and how its settings become JSON and come back."""

import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from datetime import datetime
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from app.core.errors import UsageError
from app.core.hint import Hint, Site
from app.solve.options import SolveOptions

SESSION = "session.json"
"""Versions, the camera and its settings, how frames were solved, how many there are."""
LINES = "solutions.jsonl"
"""One JSON object a frame: the answer, the frame's file and the SHA-256 of that file."""
FORMAT = 1

Json = dict[str, Any]


def options_json(options: SolveOptions) -> Json:
    """``options`` in plain JSON values."""
    told = asdict(options)
    hint = told["hint"]
    if hint is not None and hint["time_utc"] is not None:
        hint["time_utc"] = hint["time_utc"].isoformat()
    return told


def options_from(told: Any) -> SolveOptions:
    """The options of :func:`options_json`; what this version does not know is left out.

    Raises
    ------
    UsageError
        They are of kinds that options cannot be.

    """
    try:
        kinds = get_type_hints(SolveOptions)
        values = {k: v for k, v in told.items() if k in kinds}
        if values.get("hint") is not None:
            values["hint"] = _hint(values["hint"])
        for name, value in values.items():
            if name != "hint" and not _may_be(value, kinds[name]):
                raise TypeError(name)
        return SolveOptions(**values)
    except (TypeError, ValueError, AttributeError):
        raise UsageError(
            "The session's settings are damaged: frames cannot be solved alike."
        ) from None


def _may_be(value: Any, kind: Any) -> bool:
    """Whether ``value`` is of a ``kind`` or of one of several; a whole number may be a number."""
    if isinstance(kind, UnionType):
        return any(_may_be(value, one) for one in get_args(kind))
    plain = get_origin(kind) or kind
    if isinstance(value, bool):
        return plain is bool
    return isinstance(value, int | float if plain is float else plain)


def _hint(told: Mapping[str, Any]) -> Hint:
    known = {f.name for f in fields(Hint)}
    values = {k: v for k, v in told.items() if k in known}
    for name in ("scale_arcsec_px", "centre_deg"):
        if values.get(name) is not None:
            values[name] = tuple(values[name])
    if values.get("time_utc") is not None:
        values["time_utc"] = datetime.fromisoformat(values["time_utc"])
    if values.get("site") is not None:
        values["site"] = Site(**values["site"])
    return Hint(**values)


def read_session(folder: Path) -> tuple[Json, list[Json]]:
    """What ``folder`` tells of its session, and its lines in order.

    A last line that was cut off, as when the computer went down, is left out.

    Raises
    ------
    UsageError
        The folder holds no session that can be read.

    """
    try:
        about = json.loads((folder / SESSION).read_text("utf-8"))
        text = (folder / LINES).read_text("utf-8")
    except (OSError, ValueError):
        raise UsageError(
            f"{folder} holds no recorded session: there is no readable {SESSION} and {LINES}."
        ) from None
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise UsageError(f"The session in {folder} was recorded by another version of Kochab.")
    return about, _lines(text, folder)


def _lines(text: str, folder: Path) -> list[Json]:
    rows: list[Json] = []
    given = text.splitlines()
    for number, line in enumerate(given, 1):
        try:
            row = json.loads(line)
        except ValueError:
            row = None
        if isinstance(row, dict) and isinstance(row.get("frame_file"), str):
            rows.append(row)
        elif number < len(given):
            raise UsageError(f"Line {number} of {folder / LINES} is damaged.")
    return rows
