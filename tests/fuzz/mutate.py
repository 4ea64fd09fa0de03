"""Mutants of good inputs: bytes anywhere, numbers in text, and formats whose checksums are mended after."""

import gzip
import json
import re
import struct
import zlib
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

Seeds = Sequence[bytes]
Mutate = Callable[[Random, Seeds], bytes]

NUMBERS = (  # noqa: SIM905
    "0 -1 1 2 3 4 7 255 256 65535 65536 2147483647 -2147483648 4294967296 9223372036854775808 999999999 nan inf -inf"
    " 1e400 -1e400 1e-400 -0.0 1e38 0x10 1_0 1,5 ٣ - . e5 +- 1e 360 -90 90.0000001 1e5"
).split()
NUMBERS += ["9" * 400, "9" * 5000]
WORDS = [
    *(b"\0", b"\xff", b"\x7f", b"\r", b"\n", b"\t", b"#", b"'", b'"', b",", b";", b":", b"/", b"\\", b"=", b"&", b"<"),
    *(
        b"null",
        b"true",
        b"{}",
        b"[]",
        b"T",
        b"F",
        b"END",
        b"\xe2\x80\xae",
        b"\x1b[2J",
        b"../",
        b"%s",
        b"\xf0\x9f\x8c\x8c",
    ),
    *(b"[" * 100_000, b"(" * 300, b"{" * 300, b" " * 3000, b"A" * 70_000),
]
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1, 2, 1e308, 10**400, -0.0, "", "x", "\0", "nan", "1", [], {}, [None], {"a": 1}),
    *(float("nan"), float("inf"), -float("inf"), 2**31, 2**63, 2**64, "A" * 5000, "\ud800", "\x1b[31m", [0] * 300),
]
DEEP = "\ue000deep"
"""Stands in the tree for a value that is nested more than ``json.dumps`` itself can write."""
VALUES.append(DEEP)
_DEPTHS = (10, 70, 900, 1100, 100_000)
_NUMBER = re.compile(rb"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?")
_HEAD = 600  # headers are where damage is interesting


def _place(rng: Random, data: bytearray) -> int:
    end = len(data)
    return rng.randrange(min(end, _HEAD) if rng.random() < 0.5 else end) if end else 0


def _bit(rng: Random, data: bytearray, seeds: Seeds) -> None:
    if data:
        data[_place(rng, data)] ^= 1 << rng.randrange(8)


def _bytes(rng: Random, data: bytearray, seeds: Seeds) -> None:
    at = _place(rng, data)
    data[at : at + rng.choice((1, 2, 4, 8))] = rng.randbytes(rng.choice((1, 2, 4, 8)))


def _integer(rng: Random, data: bytearray, seeds: Seeds) -> None:
    at, size = _place(rng, data), rng.choice((1, 2, 4, 8))
    value = rng.choice(
        (0, 1, 2, (1 << 8 * size) - 1, 1 << (8 * size - 1), (1 << (8 * size - 1)) - 1, rng.randrange(256))
    )
    data[at : at + size] = (value % (1 << 8 * size)).to_bytes(size, rng.choice(("big", "little")))


def _cut(rng: Random, data: bytearray, seeds: Seeds) -> None:
    del data[_place(rng, data) :]


def _drop(rng: Random, data: bytearray, seeds: Seeds) -> None:
    at = _place(rng, data)
    del data[at : at + rng.choice((1, 2, 8, 80, 1000))]


def _repeat(rng: Random, data: bytearray, seeds: Seeds) -> None:
    at = _place(rng, data)
    data[at:at] = data[at : at + rng.choice((1, 8, 80, 2880))] * rng.choice((1, 1, 2, 20))


def _word(rng: Random, data: bytearray, seeds: Seeds) -> None:
    at = _place(rng, data)
    data[at:at] = rng.choice(WORDS)


def _splice(rng: Random, data: bytearray, seeds: Seeds) -> None:
    other = rng.choice(seeds)
    data[_place(rng, data) :] = other[_place(rng, bytearray(other)) :]


def _swap(rng: Random, data: bytearray, seeds: Seeds) -> None:
    size = rng.choice((1, 4, 80))
    one, two = _place(rng, data), _place(rng, data)
    if abs(one - two) >= size and max(one, two) + size <= len(data):
        data[one : one + size], data[two : two + size] = data[two : two + size], data[one : one + size]


def number(rng: Random, data: bytearray, seeds: Seeds, keep_length: bool | None = None) -> None:
    """Another number in the place of one in the text; with its length kept, cards stay where they are."""
    start = rng.randrange(max(1, min(len(data), 6000)))
    found = _NUMBER.search(data, start) or _NUMBER.search(data)
    if found is None:
        return
    new = rng.choice(NUMBERS).encode()
    first, last = found.span()
    if rng.random() < 0.5 if keep_length is None else keep_length:
        room = 20 if keep_length else last - first
        first = max(0, last - max(room, last - first)) if keep_length else first
        new = new[: last - first].rjust(last - first)
    data[first:last] = new


OPERATIONS = (_bit, _bytes, _integer, _cut, _drop, _repeat, _word, _splice, _swap, number)
ONCE_OR_MORE = (1, 1, 1, 1, 2, 2, 3, 5, 12)


def raw(rng: Random, seeds: Seeds) -> bytes:
    """Changes that know nothing of the format."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice(ONCE_OR_MORE)):
        rng.choice(OPERATIONS)(rng, data, seeds)
    return bytes(data[:2_000_000])


def fits(rng: Random, seeds: Seeds) -> bytes:
    """Mostly values of header cards, the cards left in their places."""
    if rng.random() < 0.4:
        return raw(rng, seeds)
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice(ONCE_OR_MORE)):
        at = 80 * rng.randrange(max(1, min(len(data), 17280) // 80))
        card = bytes(data[at : at + 80])
        if rng.random() < 0.7 and b"=" in card[8:10]:
            value = rng.choice(
                [*NUMBERS[:-1], "T", "F", "''", "'x'", "'" + "A" * 66, "", "'nan'", "1 2 3", "'05 29 34'"]
            )
            data[at + 10 : at + 80] = value[:70].rjust(20).ljust(70).encode("utf-8")[:70]
        elif rng.random() < 0.5:
            other = 80 * rng.randrange(max(1, len(data) // 80))
            data[at : at + 80] = data[other : other + 80].ljust(80)
        else:
            number(rng, data, seeds, keep_length=True)
    return bytes(data)


def zipped(inner: Mutate) -> Mutate:
    """Of gzipped seeds, what is inside; at times the outside."""

    def mutate(rng: Random, seeds: Seeds) -> bytes:
        if rng.random() < 0.3:
            return raw(rng, seeds)
        return gzip.compress(inner(rng, [gzip.decompress(seed) for seed in seeds]), 1, mtime=0)

    return mutate


def png(rng: Random, seeds: Seeds) -> bytes:
    """With the checksums of its chunks right again, so that decoders look further."""
    data = bytearray(raw(rng, seeds))
    at = 8
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        if at + 12 + size > len(data):
            break
        data[at + 8 + size : at + 12 + size] = struct.pack(">I", zlib.crc32(data[at + 4 : at + 8 + size]))
        at += 12 + size
    return bytes(data)


def xisf(rng: Random, seeds: Seeds) -> bytes:
    """The XML header's numbers and attributes, its length told rightly."""
    seed = rng.choice(seeds)
    if rng.random() < 0.4 or len(seed) < 16:
        return raw(rng, seeds)
    size = int.from_bytes(seed[8:12], "little")
    xml = bytearray(seed[16 : 16 + size])
    for _ in range(rng.choice(ONCE_OR_MORE)):
        rng.choice((number, number, _word, _drop, _repeat, _bytes, _bit))(rng, xml, [bytes(xml)])
    if len(xml) < size:  # what follows stays in its place
        xml += b" " * (size - len(xml))
    return seed[:8] + struct.pack("<I", len(xml)) + seed[12:16] + bytes(xml) + seed[16 + size :]


def container(rng: Random, seeds: Seeds) -> bytes:
    """A star catalogue whose JSON header has its length and its CRC right."""
    seed = rng.choice(seeds)
    size = int.from_bytes(seed[8:12], "little")
    text = tree(rng, [seed[16 : 16 + size]]) if rng.random() < 0.7 else seed[16 : 16 + size]
    body = bytearray(seed[-(-(16 + size) // 64) * 64 :])
    if rng.random() < 0.5:
        _bytes(rng, body, seeds)
    head = seed[:8] + struct.pack("<II", len(text), zlib.crc32(text)) + text
    return head.ljust(-(-len(head) // 64) * 64, b"\0") + bytes(body)


def tree(rng: Random, seeds: Seeds) -> bytes:
    """JSON whose values, names or nesting changed; at times any bytes."""
    if rng.random() < 0.25:
        return raw(rng, seeds)
    try:
        root = json.loads(rng.choice(seeds))
    except (ValueError, RecursionError):  # an earlier change made it none, or too deep
        return raw(rng, seeds)
    for _ in range(rng.choice(ONCE_OR_MORE)):
        root = _changed(rng, root)
    text = json.dumps(root, ensure_ascii=rng.random() < 0.9)
    for mark in (json.dumps(DEEP), f'"{DEEP}"'):
        while mark in text:
            text = text.replace(mark, _nested(rng), 1)
    return text.encode("utf-8", "surrogatepass")


def _nested(rng: Random) -> str:
    depth = rng.choice(_DEPTHS)
    begin, end = rng.choice((("[", "]"), ('{"a":', "}")))
    return begin * depth + "0" + end * depth


def lines(inner: Mutate) -> Mutate:
    """One line of the seed by ``inner``, or lines left out, doubled and swapped."""

    def mutate(rng: Random, seeds: Seeds) -> bytes:
        rows = rng.choice(seeds).split(b"\n")
        for _ in range(rng.choice(ONCE_OR_MORE)):
            at, other = rng.randrange(len(rows)), rng.randrange(len(rows))
            how = rng.random()
            if how < 0.7:
                rows[at] = inner(rng, [rows[at]])
            elif how < 0.8:
                rows[at] = rows[other]
            elif how < 0.9:
                rows[at], rows[other] = rows[other], rows[at]
            elif len(rows) > 1:
                del rows[at]
        return b"\n".join(rows)

    return mutate


def _changed(rng: Random, node: Any) -> Any:
    """``node`` with one thing in it changed."""
    if isinstance(node, dict) and node and rng.random() < 0.9:
        name = rng.choice(list(node))
        kind = rng.random()
        if kind < 0.8:
            return {**node, name: _changed(rng, node[name])}
        if kind < 0.9:
            return {k: v for k, v in node.items() if k != name}
        return {(rng.choice(("", "x", "name", "format", name + " ")) if k == name else k): v for k, v in node.items()}
    if isinstance(node, list) and node and rng.random() < 0.8:
        at = rng.randrange(len(node))
        return rng.choice(
            ([*node[:at], _changed(rng, node[at]), *node[at + 1 :]], node[:at] + node[at + 1 :], node + node)
        )
    if isinstance(node, int | float) and rng.random() < 0.4:
        return node * rng.choice((-1, 0, 1e300, 10, 0.5)) if abs(node) < 1e300 else 0
    return rng.choice(VALUES)
