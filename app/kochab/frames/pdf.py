"""A one-page PDF of lines, discs, a picture and text that stays text; the font travels inside (PDF 32000-1:2008).

Places are points (1/72 inch) from the page's upper left corner, y down.
"""

import struct
import zlib
from collections.abc import Iterable
from dataclasses import field
from functools import lru_cache
from pathlib import Path

from kochab.core.arrays import Floats
from kochab.core.errors import KochabError
from kochab.core.values import frozen, mutable

A4, LETTER = (595.28, 841.89), (612.0, 792.0)
MEANING_BEGINS = """/CIDInit /ProcSet findresource begin 12 dict begin begincmap /CMapName /K def /CMapType 2 def
1 begincodespacerange <0000> <ffff> endcodespacerange"""
MEANING_ENDS = "endbfchar endcmap CMapName currentdict /CMap defineresource pop end end"
_CONTROL_OF_CIRCLE = 0.5523  # a quarter of a circle as a Bezier curve


@frozen
class Font:
    """A TrueType font: its bytes, glyphs by character, their widths and the box, in thousandths of its size."""

    data: bytes
    glyphs: dict[int, int]
    widths: tuple[float, ...]
    box: tuple[int, int, int, int]

    def width(self, text: str) -> float:
        """Of a text, for letters of one point."""
        return sum(self.widths[self.glyphs.get(ord(letter), 0)] for letter in text) / 1000.0


@lru_cache(maxsize=2)
def read_font(path: Path) -> Font:
    """Read a TrueType file (tables head, hhea, hmtx and a cmap of format 4); KochabError when it is none."""
    try:
        data = path.read_bytes()
        tables = {}
        for k in range(struct.unpack_from(">H", data, 4)[0]):
            tag, _, at, _ = struct.unpack_from(">4sIII", data, 12 + 16 * k)
            tables[tag] = at
        scale = 1000.0 / struct.unpack_from(">H", data, tables[b"head"] + 18)[0]
        box = struct.unpack_from(">4h", data, tables[b"head"] + 36)
        count = struct.unpack_from(">H", data, tables[b"hhea"] + 34)[0]
        pairs = struct.unpack_from(f">{2 * count}H", data, tables[b"hmtx"])
        last = struct.unpack_from(">H", data, tables[b"maxp"] + 4)[0] - count
        widths = [width * scale for width in pairs[::2]]
        left, low, right, high = (round(side * scale) for side in box)
        glyphs = _characters(data, tables[b"cmap"])
        return Font(data, glyphs, (*widths, *[widths[-1]] * last), (left, low, right, high))
    except (OSError, KeyError, struct.error, IndexError) as error:
        raise KochabError("{name} is no TrueType font ({error}).", name=path.name, error=error) from error


def _characters(data: bytes, cmap: int) -> dict[int, int]:
    """Glyphs by character, of the table of format 4."""
    for k in range(struct.unpack_from(">H", data, cmap + 2)[0]):
        at = cmap + struct.unpack_from(">I", data, cmap + 8 + 8 * k)[0]
        if struct.unpack_from(">H", data, at)[0] == 4:
            break
    else:
        raise KeyError("cmap 4")
    half = struct.unpack_from(">H", data, at + 6)[0] // 2
    ends, starts, deltas, offsets = (
        struct.unpack_from(f">{half}H", data, at + 14 + 2 * half * row + (2 if row else 0)) for row in range(4)
    )
    found = {}
    for k, (end, start, delta, offset) in enumerate(zip(ends, starts, deltas, offsets, strict=True)):
        for code in range(start, min(end, 0xFFFE) + 1):
            glyph = code
            if offset:
                place = at + 16 + 6 * half + 2 * k + offset + 2 * (code - start)
                glyph = struct.unpack_from(">H", data, place)[0]
            if glyph or not offset:
                found[code] = (glyph + delta) % 65536
    return found


@mutable
class Page:
    """What is drawn, in order; :meth:`packed` gives the file."""

    width: float
    height: float
    font: Font
    title: str = ""
    _drawn: list[str] = field(default_factory=list)
    _used: dict[int, str] = field(default_factory=dict)
    _picture: tuple[bytes, int, int] | None = None
    _opacities: dict[int, str] = field(default_factory=dict)

    def line(self, xy: Floats, ink: str, width: float) -> None:
        """A chain of places (N, 2); ``ink`` is "#rrggbb" or "#rrggbbaa"."""
        if len(xy) > 1:
            points = [f"{x:.2f} {self.height - y:.2f}" for x, y in xy.tolist()]
            rest = " ".join(f"{point} l" for point in points[1:])
            self._drawn.append(f"{self._ink(ink, 'RG')} {width:.2f} w {points[0]} m {rest} S")

    def discs(self, xy: Floats, radii: Iterable[float], ink: str) -> None:
        """Filled circles about places (N, 2)."""
        self._drawn.append(self._ink(ink, "rg"))
        for (x, y), r in zip(xy.tolist(), radii, strict=True):
            y, k = self.height - y, _CONTROL_OF_CIRCLE * r
            self._drawn.append(
                f"{x + r:.2f} {y:.2f} m {x + r:.2f} {y + k:.2f} {x + k:.2f} {y + r:.2f} {x:.2f} {y + r:.2f} c "
                f"{x - k:.2f} {y + r:.2f} {x - r:.2f} {y + k:.2f} {x - r:.2f} {y:.2f} c "
                f"{x - r:.2f} {y - k:.2f} {x - k:.2f} {y - r:.2f} {x:.2f} {y - r:.2f} c "
                f"{x + k:.2f} {y - r:.2f} {x + r:.2f} {y - k:.2f} {x + r:.2f} {y:.2f} c f"
            )

    def text(self, x: float, y: float, text: str, size: float, ink: str = "#000000") -> None:
        """A line of text.

        Parameters
        ----------
        x, y : float
            Where its baseline begins, points.
        text : str
            What it says.
        size : float
            Of the letters, points.
        ink : str
            "#rrggbb".
        """
        glyphs = [self.font.glyphs.get(ord(letter), 0) for letter in text]
        self._used |= dict(zip(glyphs, text, strict=True))
        codes = "".join(f"{glyph:04x}" for glyph in glyphs)
        place = f"{x:.2f} {self.height - y:.2f}"
        self._drawn.append(f"BT {self._ink(ink, 'rg')} /F1 {size:.2f} Tf {place} Td <{codes}> Tj ET")

    def halo(self, x: float, y: float, text: str, size: float) -> None:
        """A dark edge of a text that will be drawn over it; it is no second text for whoever searches or copies.

        Parameters
        ----------
        x, y : float
            Where its baseline begins, points.
        text : str
            What it says.
        size : float
            Of the letters, points.
        """
        codes = "".join(f"{self.font.glyphs.get(ord(letter), 0):04x}" for letter in text)
        place = f"{x:.2f} {self.height - y:.2f}"
        edge = f"{self._ink('#0c0e11', 'RG')} 1 Tr {size / 6.0:.2f} w 1 j"
        self._drawn.append(f"/Artifact BMC BT {edge} /F1 {size:.2f} Tf {place} Td <{codes}> Tj 0 Tr ET EMC")

    def picture(self, jpeg: bytes, size_px: tuple[int, int], box: tuple[float, float, float, float]) -> None:
        """An RGB picture as JPEG in a box (x, y, width, height); one a page."""
        x, y, width, height = box
        self._picture = (jpeg, *size_px)
        self._drawn.append(f"q {width:.2f} 0 0 {height:.2f} {x:.2f} {self.height - y - height:.2f} cm /P1 Do Q")

    def clip(self, x: float, y: float, width: float, height: float) -> None:
        """What follows is drawn in this box alone, until :meth:`unclip`.

        Parameters
        ----------
        x, y : float
            The box's upper left corner, points.
        width, height : float
            Of the box, points.
        """
        self._drawn.append(f"q {x:.2f} {self.height - y - height:.2f} {width:.2f} {height:.2f} re W n")

    def unclip(self) -> None:
        """Draw on the whole page again."""
        self._drawn.append("Q")

    def _ink(self, ink: str, operator: str) -> str:
        opaque = int(ink[7:9] or "ff", 16)
        name = self._opacities.setdefault(opaque, f"G{len(self._opacities)}")
        red, green, blue = (int(ink[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        return f"/{name} gs {red:.3f} {green:.3f} {blue:.3f} {operator}"

    def packed(self) -> bytes:
        """The file."""
        states = " ".join(f"/{name} << /CA {a / 255:.3f} /ca {a / 255:.3f} >>" for a, name in self._opacities.items())
        used = sorted(self._used)
        widths = " ".join(f"{glyph} [{self.font.widths[glyph]:.0f}]" for glyph in used)
        unicode = "".join(f"<{g:04x}> <{self._used[g].encode('utf-16-be').hex()}>\n" for g in used)
        meaning = "\n".join([MEANING_BEGINS, str(len(used)) + " beginbfchar", unicode + MEANING_ENDS])
        picture = "/XObject << /P1 11 0 R >>" if self._picture else ""
        box = " ".join(map(str, self.font.box))
        name = "/DejaVuSans"
        objects = [
            b"<< /Type /Catalog /Pages 2 0 R >>",
            b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {self.width} {self.height}] /Contents 4 0 R /Resources << "
            f"/Font << /F1 5 0 R >> /ExtGState << {states} >> {picture} >> >>".encode(),
            _stream("\n".join(self._drawn).encode("ascii")),
            f"<< /Type /Font /Subtype /Type0 /BaseFont {name} /Encoding /Identity-H /DescendantFonts [6 0 R] "
            "/ToUnicode 9 0 R >>".encode(),
            f"<< /Type /Font /Subtype /CIDFontType2 /BaseFont {name} /CIDSystemInfo << /Registry (Adobe) /Ordering "
            f"(Identity) /Supplement 0 >> /FontDescriptor 7 0 R /CIDToGIDMap /Identity /DW 600 /W [{widths}] "
            ">>".encode(),
            f"<< /Type /FontDescriptor /FontName {name} /Flags 32 /FontBBox [{box}] /ItalicAngle 0 /Ascent 928 "
            "/Descent -236 /CapHeight 729 /StemV 80 /FontFile2 8 0 R >>".encode(),
            _stream(self.font.data, f"/Length1 {len(self.font.data)}"),
            _stream(meaning.encode("ascii")),
            f"<< /Title <feff{self.title.encode('utf-16-be').hex()}> /Producer (Kochab) >>".encode(),
        ]
        if self._picture:
            jpeg, wide, high = self._picture
            head = (
                f"<< /Type /XObject /Subtype /Image /Width {wide} /Height {high} /ColorSpace /DeviceRGB "
                f"/BitsPerComponent 8 /Filter /DCTDecode /Length {len(jpeg)} >>\nstream\n"
            )
            objects.append(head.encode() + jpeg + b"\nendstream")
        return _file(objects)


def _stream(content: bytes, more: str = "") -> bytes:
    packed = zlib.compress(content, 9)
    return f"<< /Filter /FlateDecode /Length {len(packed)} {more} >>\nstream\n".encode() + packed + b"\nendstream"


def _file(objects: list[bytes]) -> bytes:
    """The objects, where each begins, and the trailer; object 10 is the document's title."""
    made, places = bytearray(b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n"), []
    for number, one in enumerate(objects, 1):
        places.append(len(made))
        made += f"{number} 0 obj\n".encode() + one + b"\nendobj\n"
    begun = len(made)
    made += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n".encode()
    made += b"".join(f"{place:010d} 00000 n \n".encode() for place in places)
    made += f"trailer << /Size {len(objects) + 1} /Root 1 0 R /Info 10 0 R >>\nstartxref\n{begun}\n%%EOF\n".encode()
    return bytes(made)
