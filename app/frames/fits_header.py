"""FITS headers, read leniently: a card that breaks the standard costs a warning, not the frame.

Written after the FITS standard 4.0, section 4.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from app.core.errors import FrameError

BLOCK = 2880
_CARD = 80
_MAX_BLOCKS = 2000

_STRING = re.compile(r"\s*'((?:[^']|'')*)'\s*(?:/.*)?$")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+)?$")
_NAME = re.compile(r"[A-Z0-9_-]*$")


@dataclass(slots=True)
class Header:
    """Keyword values, the comments beside them, and the keywords of cards that did not parse."""

    values: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    unparsed: list[str] = field(default_factory=list)

    def integer(self, name: str, default: int | None = None) -> int:
        """A keyword that must be a whole number.

        Raises
        ------
        FrameError
            When it is absent without a default, or something else.
        """
        value = self.values.get(name, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise FrameError(f"is a damaged FITS file: its header has no valid {name}.")
        return value

    def number(self, name: str, default: float) -> float:
        """A keyword that should be a number, else the default."""
        value = self.values.get(name, default)
        ok = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if ok else default

    def shape(self, prefix: str = "") -> tuple[int, ...]:
        """The array's shape in numpy's order (last axis first); ``prefix`` Z for compressed."""
        count = self.integer(f"{prefix}NAXIS")
        if not 0 <= count <= 999:
            raise FrameError(f"is a damaged FITS file: it claims {count} axes.")
        sizes = [self.integer(f"{prefix}NAXIS{i + 1}") for i in range(count)]
        if any(s < 0 for s in sizes):
            raise FrameError("is a damaged FITS file: it claims an axis of negative length.")
        return tuple(reversed(sizes))


def read_header(file: BinaryIO) -> Header | None:
    """The header at the file's position, leaving it at the data; None at the end of the file.

    Raises
    ------
    FrameError
        When there is no END within the file.
    """
    cards: list[str] = []
    for number in range(_MAX_BLOCKS):
        block = file.read(BLOCK)
        if len(block) < BLOCK:
            if not number and not block.strip(b"\x00 \r\n"):
                return None
            if b"END" + b" " * 77 not in block:
                raise FrameError("is cut short: its FITS header does not end.")
        text = block.decode("latin-1")
        lines = [text[i : i + _CARD] for i in range(0, len(text), _CARD)]
        for line in lines:
            if line.rstrip(" \x00") == "END":
                return parse_cards(cards)
            cards.append(line)
    raise FrameError("is a damaged FITS file: its header does not end.")


def parse_cards(cards: Iterable[str]) -> Header:
    """A header from cards of 80 characters; the first of repeated keywords wins."""
    header = Header()
    last = ""
    for card in cards:
        name = card[:8].rstrip()
        if name in ("COMMENT", "HISTORY", ""):
            continue
        if name == "CONTINUE":
            _continue(header, last, card[8:])
            continue
        body = card[10:]
        if name == "HIERARCH" and "=" in card:
            name, body = (part.strip() for part in card[9:].split("=", 1))
        elif card[8:9] == "=" and card[9:10].strip():
            body = card[9:]  # a value that lacks the space before it, as some programs write
        elif card[8:10].rstrip() != "=":
            if not _NAME.match(name):
                header.unparsed.append(_printable(name))
            continue
        last = name
        if name in header.values:
            continue
        value, comment, ok = parse_value(body)
        header.values[name] = value
        header.comments[name] = comment
        if not ok:
            header.unparsed.append(_printable(name))
    return header


def parse_value(body: str) -> tuple[Any, str, bool]:
    """A card's value, its comment, and whether it kept to the standard.

    What does not parse comes back as bare text, since it often still means something
    (``RA = 05 29 34``).
    """
    if string := _STRING.match(body):
        comment = body[string.end(1) + 1 :].partition("/")[2].strip()
        return string[1].replace("''", "'").rstrip(), comment, True
    text, _, comment = body.partition("/")
    text, comment = text.strip(), comment.strip()
    if text in ("T", "F"):
        return text == "T", comment, True
    if not text:
        return None, comment, True
    if number := _NUMBER.match(text):
        if number[2] is None and "." not in number[1]:
            return (int(text), comment, True) if len(text) < 25 else (float(text), comment, True)
        return float(text.upper().replace("D", "E")), comment, True
    return text.strip("' "), comment, False


def _continue(header: Header, name: str, body: str) -> None:
    held = header.values.get(name)
    value, _, ok = parse_value(body)
    if ok and isinstance(held, str) and held.endswith("&") and isinstance(value, str):
        header.values[name] = held[:-1] + value


def _printable(name: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in name)
