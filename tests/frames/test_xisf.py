"""XISF files that were made to do harm, and properties that nobody needs."""

import struct
import zlib

import numpy as np
import pytest

from kochab.core.errors import FrameError
from kochab.frames import read_frame

HEADER = (
    '<?xml version="1.0" encoding="UTF-8"?>{doctype}'
    '<xisf version="1.0" xmlns="http://www.pixinsight.com/xisf">'
    '<Image geometry="{geometry}" sampleFormat="UInt16" colorSpace="Gray"'
    ' location="attachment:4096:{size}" {more}>{inside}</Image>'
    '<Metadata><Property id="XISF:CreationTime" type="TimePoint" value="2026"/></Metadata></xisf>'
)
LAUGHS = "".join(
    f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12)
)  # a billion of them, and more
PIXELS = np.arange(40 * 30, dtype="<u2").reshape(30, 40)


def written(folder, data: bytes, geometry="40:30:1", doctype="", more="", inside=""):
    text = HEADER.format(doctype=doctype, geometry=geometry, size=len(data), more=more, inside=inside).encode()
    path = folder / "a.xisf"
    head = b"XISF0100" + struct.pack("<II", len(text), 0) + text
    path.write_bytes(head.ljust(4096, b"\0") + data)
    return path


@pytest.mark.parametrize("shuffled", [False, True])
def test_zlib_is_read(tmp_path, shuffled) -> None:
    plain = PIXELS.tobytes()
    more = f'compression="zlib:{len(plain)}"'
    if shuffled:
        plain = PIXELS.view(np.uint8).reshape(-1, 2).T.tobytes()
        more = f'compression="zlib+sh:{len(plain)}:2"'
    frame = read_frame(written(tmp_path, zlib.compress(plain), more=more))
    np.testing.assert_array_equal(frame.pixels, PIXELS)


@pytest.mark.parametrize("grown", [1, 50_000_000])
def test_more_packed_than_told_is_refused_unseen(tmp_path, grown, monkeypatch) -> None:
    packed = zlib.compress(PIXELS.tobytes() + bytes(grown))
    path = written(tmp_path, packed, more=f'compression="zlib:{PIXELS.nbytes}"')
    monkeypatch.setattr(zlib, "decompress", None)  # which knows no limit
    with pytest.raises(FrameError, match="sizes do not agree"):
        read_frame(path)


@pytest.mark.parametrize(
    "inside",
    [
        '<Property id="a" type="Float64" value="inf"/>',
        '<Property id="a" type="Vector" length="9" location="attachment:-1:99"/>',
        '<Property id="a" type="F64Vector" length="9" location="attachment:4096:9999999999"'
        ' compression="zlib:99999999999"/>',
        "<Property/>",
    ],
)
def test_properties_cost_nothing(tmp_path, inside) -> None:
    frame = read_frame(written(tmp_path, PIXELS.tobytes(), inside=inside))
    np.testing.assert_array_equal(frame.pixels, PIXELS)


@pytest.mark.parametrize(
    ("doctype", "inside"),
    [
        (f'<!DOCTYPE l [<!ENTITY a "aaaaaaaaaa">{LAUGHS}]>', "&m;"),
        ('<!DOCTYPE l [<!ENTITY x SYSTEM "file:///etc/passwd">]>', "&x;"),
    ],
)
def test_hostile_entities_are_refused(tmp_path, doctype, inside) -> None:
    with pytest.raises(FrameError, match="damaged"):
        read_frame(written(tmp_path, PIXELS.tobytes(), doctype=doctype, inside=inside))


@pytest.mark.parametrize("geometry", ["-40:-30:1", "100000:100000:1", "40:30:999", "4:3", "a:b:1"])
def test_impossible_sizes_are_refused(tmp_path, geometry) -> None:
    with pytest.raises(FrameError, match=r"^a\.xisf .*\.$"):
        read_frame(written(tmp_path, PIXELS.tobytes(), geometry=geometry))
