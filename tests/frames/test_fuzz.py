"""Damaged files of every format end in a frame or in one sentence, nothing else."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.frames import read_frame
from tests.frames.files import one_of_each

NAMES = (
    "a.fits",
    "a.fits.fz",
    "a.fits.gz",
    "a.xisf",
    "z.xisf",
    "a.tif",
    "z.tif",
    "a.png",
    "a.jpg",
    "a.bmp",
    "a.gif",
    "a.webp",
    "d16.png",
    "a.heic",
    "a.dng",
    "a.ser",
    "a.avi",
)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    contents = {p.name: p.read_bytes() for p in one_of_each(folder)}
    assert sorted(contents) == sorted(NAMES)
    return contents


def opens_or_says_why(path):
    said = None
    try:
        frame = read_frame(path)
    except FrameError as error:
        said = str(error)
    if said is None:
        assert isinstance(frame, Frame)
        assert frame.pixels.ndim == 2
    else:
        assert "\n" not in said
        assert said.endswith(".")
        assert path.name in said


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_cut_anywhere(good, tmp_path, name, data):
    whole = good[name]
    path = tmp_path / name
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    opens_or_says_why(path)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_flipped_bytes(good, tmp_path, name, data):
    broken = bytearray(good[name])
    # Headers are where damage is interesting.
    place = st.one_of(st.integers(0, min(400, len(broken) - 1)), st.integers(0, len(broken) - 1))
    for at, value in data.draw(st.lists(st.tuples(place, st.integers(0, 255)), min_size=1, max_size=8)):
        broken[at] = value
    path = tmp_path / name
    path.write_bytes(bytes(broken))
    opens_or_says_why(path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    head=st.sampled_from(
        [
            b"SIMPLE  =",
            b"\x1f\x8b\x08",
            b"XISF0100",
            b"\x89PNG\r\n\x1a\n",
            b"\xff\xd8\xff\xe0",
            b"GIF89a",
            b"BM",
            b"FUJIFILMCCD-RAW",
            b"IIRO",
            b"IIU\x00",
            b"II*\x00",
            b"MM\x00*",
            b"II+\x00",
            b"\x00\x00\x00\x18ftypheic",
            b"\x00\x00\x00\x18ftypcrx ",
            b"RIFF\x00\x00\x00\x00WEBP",
            b"",
        ]
    ),
    rest=st.binary(max_size=400),
    suffix=st.sampled_from([".fits", ".cr2", ".jpg", ".xyz"]),
)
def test_a_good_beginning_and_then_anything(tmp_path, head, rest, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(head + rest)
    opens_or_says_why(path)
