"""What a person types to name a camera, and the bytes that come back."""

import io
import zlib
from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from kochab.core.errors import FrameError, PortError
from kochab.gear.cameras.indi import frame_of
from kochab.gear.servers.address import NetAddress, net_address


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", ("localhost", 7624, "")),
        ("pi.local", ("pi.local", 7624, "")),
        ("pi.local:1234", ("pi.local", 1234, "")),
        ("pi.local/ZWO CCD ASI120MM", ("pi.local", 7624, "ZWO CCD ASI120MM")),
        ("10.0.0.2:99/0", ("10.0.0.2", 99, "0")),
        (" http://10.0.0.2:99/ ", ("10.0.0.2", 99, "")),
        ("[fe80::1]:99/a/b", ("[fe80::1]", 99, "a/b")),
        ("[::1]", ("[::1]", 7624, "")),
        ("/Camera", ("localhost", 7624, "Camera")),
    ],
)
def test_host_port_and_camera(text, found) -> None:
    assert net_address(text, 7624) == NetAddress(*found)


@pytest.mark.parametrize("text", ["pi:camera", "pi:0", "pi:70000", "pi:-1", "pi:１"])
def test_a_port_that_is_none(text) -> None:
    with pytest.raises(PortError, match="is not a port; write the address as host:7624"):
        net_address(text, 7624)


@given(st.text(max_size=30))
def test_any_text_is_an_address_or_a_sentence(text) -> None:
    try:
        found = net_address(text, 7624)
    except PortError:
        return
    assert 1 <= found.port <= 65535
    assert found.host


def fits_file(pixels):
    out = io.BytesIO()
    fits.PrimaryHDU(pixels).writeto(out)
    return out.getvalue()


PIXELS = np.random.default_rng(1).integers(0, 60000, (30, 40)).astype(np.uint16)


def test_fits_png_and_packed_fits() -> None:
    plain = fits_file(PIXELS)
    png = io.BytesIO()
    Image.fromarray(PIXELS).save(png, "PNG")
    packed = zlib.compress(plain)
    for data, suffix in ((plain, ".fits"), (packed, ".fits.z"), (png.getvalue(), ".png")):
        frame = frame_of(data, suffix, "Camera 7")
        assert np.array_equal(frame.pixels, PIXELS)
        assert frame.path == "Camera 7"


@pytest.mark.parametrize("suffix", [".fits", ".fits.z", ".png"])
@pytest.mark.parametrize("data", [b"", b"nonsense", fits_file(PIXELS)[:4000], zlib.compress(b"x" * 99)[:9]])
def test_what_is_no_picture_is_a_sentence(data, suffix) -> None:
    with pytest.raises(FrameError) as caught:
        frame_of(data, suffix, "Camera 7")
    assert "\n" not in str(caught.value)
    assert "Camera 7" in str(caught.value)


@pytest.mark.parametrize("suffix", ["/../../outside.png", "\\..\\..\\outside.png", "\0.png", "." * 300])
def test_a_suffix_names_no_other_place(tmp_path, monkeypatch, suffix) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    written = []
    write = Path.write_bytes
    monkeypatch.setattr(Path, "write_bytes", lambda self, d: (written.append(self), write(self, d)))
    with pytest.raises(FrameError, match="Camera 7"):
        frame_of(b"no picture", suffix, "Camera 7")
    assert written[0].parent.parent == tmp_path
    assert written[0].name.startswith("frame")
