"""A DLL whose functions do nothing, to replace one that is linked but never used.

The layout is Microsoft's "PE Format" (learn.microsoft.com/windows/win32/debug/pe-format): PE32+, one section.
"""

import struct
from collections.abc import Collection

_RETURNS_ZERO = b"\x31\xc0\xc3" + bytes(13)  # xor eax, eax; ret
_PAGE, _BLOCK = 0x1000, 0x200


def empty_dll(name: str, functions: Collection[str]) -> bytes:
    """An x64 DLL whose functions do nothing but return 0."""
    section = _RETURNS_ZERO
    exported = sorted(functions)
    count = len(exported)
    table = _PAGE + len(section)
    places, names, ordinals = (table + 40 + at * count for at in (0, 4, 8))
    texts, ends = b"", []
    for text in (name, *exported):
        ends.append(ordinals + 2 * count + len(texts))
        texts += text.encode("ascii") + b"\0"
    section += struct.pack("<IIHHIIIIIII", 0, 0, 0, 0, ends[0], 1, count, count, places, names, ordinals)
    section += struct.pack(f"<{2 * count}I{count}H", *[_PAGE] * count, *ends[1:], *range(count)) + texts
    size = len(section)
    section += bytes(-size % _BLOCK)
    whole = _PAGE + size + -size % _PAGE
    head = b"MZ".ljust(60, b"\0") + struct.pack("<I", 64) + b"PE\0\0"
    # x64, one section, no time; a program, for more than 2 GB, a DLL
    head += struct.pack("<HHIIIHH", 0x8664, 1, 0, 0, 0, 240, 0x2022)
    # No entry point: the loader then calls nothing.
    head += struct.pack("<HBBIIIII", 0x20B, 1, 0, len(section), 0, 0, 0, _PAGE)
    head += struct.pack("<QIIHHHHHHIIIIHH", 0x180000000, _PAGE, _BLOCK, 6, 0, 0, 0, 6, 0, 0, whole, _BLOCK, 0, 2, 0x160)
    head += struct.pack("<QQQQII", 0x100000, 0x1000, 0x100000, 0x1000, 0, 16)
    head += struct.pack("<II", table, size - len(_RETURNS_ZERO)) + bytes(15 * 8)
    # Code, initialized data; may be executed and read
    head += struct.pack("<8sIIIIIIHHI", b".text", size, _PAGE, len(section), _BLOCK, 0, 0, 0, 0, 0x60000060)
    return head.ljust(_BLOCK, b"\0") + section
